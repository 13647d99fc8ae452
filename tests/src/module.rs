//! What a SPIR-V module declares: its entry points and the variables that each uses, with their layout.

use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Op, StorageClass, Word};
use std::collections::{BTreeMap, BTreeSet};

/// A module with what is looked up in it often.
pub struct Declarations<'a> {
    module: &'a Module,
    definitions: BTreeMap<Word, &'a Instruction>,
    globals: BTreeMap<Word, &'a Instruction>,
    annotations: BTreeMap<Word, Vec<&'a Instruction>>,
}

/// What a variable's block holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// An array without a length, of elements at this distance.
    Elements {
        /// Bytes from an element to the next.
        stride: usize,
    },
    /// Something of this length.
    Fixed {
        /// In bytes.
        bytes: usize,
    },
}

impl<'a> Declarations<'a> {
    /// Of a module.
    pub fn new(module: &'a Module) -> Declarations<'a> {
        let by_result = |instruction: &'a Instruction| Some((instruction.result_id?, instruction));
        let definitions = module.all_inst_iter().filter_map(by_result).collect();
        let globals = module.types_global_values.iter().filter_map(by_result).collect();
        let mut annotations: BTreeMap<Word, Vec<&Instruction>> = BTreeMap::new();
        for annotation in &module.annotations {
            annotations.entry(id_of(annotation, 0)).or_default().push(annotation);
        }
        Declarations { module, definitions, globals, annotations }
    }

    /// The instruction whose result has this number.
    ///
    /// # Panics
    /// If there is none.
    pub fn definition(&self, id: Word) -> &'a Instruction {
        self.definitions.get(&id).copied().unwrap_or_else(|| panic!("nothing defines %{id}"))
    }

    /// Functions that the entry point's function consists of: itself, and what it calls.
    pub fn functions(&self, entry: Word) -> Vec<&'a Function> {
        let (mut found, mut open) = (BTreeMap::new(), vec![entry]);
        while let Some(id) = open.pop() {
            let function = self.module.functions.iter().find(|function| function.def_id() == Some(id));
            let function = function.unwrap_or_else(|| panic!("there is no function %{id}"));
            if found.insert(id, function).is_none() {
                let calls = instructions(function).filter(|instruction| instruction.class.opcode == Op::FunctionCall);
                open.extend(calls.filter_map(|call| call.operands.first().and_then(Operand::id_ref_any)));
            }
        }
        found.into_values().collect()
    }

    /// What functions use of the module's variables and constants, directly or as part of a constant.
    pub fn used(&self, functions: &[&Function]) -> BTreeSet<Word> {
        let mut used = BTreeSet::new();
        let operands = functions.iter().flat_map(|function| instructions(function)).flat_map(|i| &i.operands);
        let mut open: Vec<Word> = operands.filter_map(Operand::id_ref_any).collect();
        while let Some(id) = open.pop() {
            let Some(global) = self.globals.get(&id) else { continue };
            if used.insert(id) {
                open.extend(global.operands.iter().filter_map(Operand::id_ref_any));
            }
        }
        used
    }

    /// The storage class of a variable, if it is one.
    pub fn storage_class(&self, id: Word) -> Option<StorageClass> {
        let definition = self.definition(id);
        match (definition.class.opcode, definition.operands.first()) {
            (Op::Variable, Some(Operand::StorageClass(class))) => Some(*class),
            _ => None,
        }
    }

    /// Whether something is a pointer into this storage class.
    pub fn is_pointer_to(&self, id: Word, class: StorageClass) -> bool {
        let kind = self.definition(id).result_type.map(|kind| self.definition(kind));
        kind.is_some_and(|kind| kind.operands.first() == Some(&Operand::StorageClass(class)))
    }

    /// Whether a number is decorated so.
    pub fn is_decorated(&self, id: Word, decoration: Decoration) -> bool {
        self.decorations(id, decoration).next().is_some()
    }

    /// The number that belongs to a decoration.
    pub fn decorated(&self, id: Word, decoration: Decoration) -> Option<u32> {
        self.decorations(id, decoration).next()?.operands.get(2).map(Operand::unwrap_literal_bit32)
    }

    fn decorations(&self, id: Word, decoration: Decoration) -> impl Iterator<Item = &'a Instruction> {
        self.annotations_of(id).filter(move |annotation| {
            annotation.class.opcode == Op::Decorate && annotation.operands[1] == Operand::Decoration(decoration)
        })
    }

    fn annotations_of(&self, id: Word) -> impl Iterator<Item = &'a Instruction> {
        self.annotations.get(&id).into_iter().flatten().copied()
    }

    /// What the block behind a variable holds.
    pub fn content(&self, variable: Word) -> Content {
        let pointer = self.definition(self.definition(variable).result_type.expect("a variable's type"));
        let block = self.definition(id_of(pointer, 1));
        assert_eq!(block.class.opcode, Op::TypeStruct, "a variable of a block");
        // A block of one member is what the shader's parameter was wrapped in.
        let inner = self.definition(id_of(block, 0));
        if inner.class.opcode == Op::TypeRuntimeArray {
            let stride = self.decorated(inner.result_id.expect("a type"), Decoration::ArrayStride);
            return Content::Elements { stride: stride.expect("a stride") as usize };
        }
        Content::Fixed { bytes: self.bytes(block) }
    }

    /// Bytes of a variable that has no layout of its own: nobody but the module sees it.
    pub fn variable_bytes(&self, variable: Word) -> usize {
        let pointer = self.definition(self.definition(variable).result_type.expect("a variable's type"));
        self.packed_bytes(self.definition(id_of(pointer, 1)))
    }

    fn packed_bytes(&self, kind: &Instruction) -> usize {
        let inner = || self.packed_bytes(self.definition(id_of(kind, 0)));
        match kind.class.opcode {
            Op::TypeInt | Op::TypeFloat => kind.operands[0].unwrap_literal_bit32() as usize / 8,
            Op::TypeVector => kind.operands[1].unwrap_literal_bit32() as usize * inner(),
            Op::TypeArray => self.constant(id_of(kind, 1)) as usize * inner(),
            other => panic!("{other:?} is not known here"),
        }
    }

    /// Bytes from the first of a type to its last.
    fn bytes(&self, kind: &Instruction) -> usize {
        match kind.class.opcode {
            Op::TypeInt | Op::TypeFloat => kind.operands[0].unwrap_literal_bit32() as usize / 8,
            Op::TypeArray => {
                let stride = self.decorated(kind.result_id.expect("a type"), Decoration::ArrayStride);
                stride.expect("a stride") as usize * self.constant(id_of(kind, 1)) as usize
            }
            Op::TypeStruct => {
                let ends = (0..kind.operands.len())
                    .map(|member| self.offset(kind, member) + self.bytes(self.definition(id_of(kind, member))));
                ends.max().unwrap_or_default()
            }
            other => panic!("{other:?} has no layout that is known here"),
        }
    }

    fn offset(&self, kind: &Instruction, member: usize) -> usize {
        let is_its = |annotation: &&Instruction| {
            annotation.class.opcode == Op::MemberDecorate
                && annotation.operands[1] == Operand::LiteralBit32(member as u32)
                && annotation.operands[2] == Operand::Decoration(Decoration::Offset)
        };
        let offset = self.annotations_of(kind.result_id.expect("a type")).find(is_its).expect("a member's offset");
        offset.operands[3].unwrap_literal_bit32() as usize
    }

    /// The value of a constant of 32 bits.
    pub fn constant(&self, id: Word) -> u32 {
        self.definition(id).operands[0].unwrap_literal_bit32()
    }

    /// The variable that a pointer leads into, through any number of access chains.
    pub fn variable_behind(&self, pointer: Word) -> Word {
        let definition = self.definition(pointer);
        match definition.class.opcode {
            Op::AccessChain | Op::InBoundsAccessChain | Op::CopyObject => self.variable_behind(id_of(definition, 0)),
            _ => pointer,
        }
    }
}

/// All instructions of a function's blocks.
pub fn instructions(function: &Function) -> impl Iterator<Item = &Instruction> {
    function.blocks.iter().flat_map(|block| &block.instructions)
}

/// The number that an operand refers to.
pub fn id_of(instruction: &Instruction, operand: usize) -> Word {
    instruction.operands[operand].id_ref_any().expect("a reference")
}
