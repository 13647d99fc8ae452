//! Small modules that a test makes: their common beginning, and executing them.

use rspirv::dr::{Builder, Instruction, Module, Operand};
use rspirv::spirv::{
    AddressingModel, Capability, ExecutionModel, FunctionControl, MemoryModel, Op, StorageClass, Word,
};
use std::collections::HashMap;
use viewfuse_tests::module::id_of;

/// Numbers of the variables that a module reads and writes: the first two.
pub(crate) const LIMIT: Word = 1;
pub(crate) const RESULT: Word = 2;

/// A module in which the function of this name has begun, and its types of truth values and of numbers.
pub(crate) fn begun(name: &str) -> (Builder, Word, Word) {
    let mut b = Builder::new();
    let [limit, result] = [b.id(), b.id()];
    assert_eq!([limit, result], [LIMIT, RESULT]);
    b.capability(Capability::Shader);
    b.memory_model(AddressingModel::Logical, MemoryModel::GLSL450);
    let (void, boolean, number) = (b.type_void(), b.type_bool(), b.type_int(32, 0));
    let kind = b.type_function(void, []);
    let pointer = b.type_pointer(None, StorageClass::Private, number);
    b.variable(pointer, Some(limit), StorageClass::Private, None);
    b.variable(pointer, Some(result), StorageClass::Private, None);
    let function = b.begin_function(void, None, FunctionControl::NONE, kind).expect("a function");
    b.entry_point(ExecutionModel::GLCompute, function, name, [limit, result]);
    (b, boolean, number)
}

/// Begins a block.
pub(crate) fn block(b: &mut Builder, label: Word) {
    b.begin_block(Some(label)).expect("a block");
}

/// The module, whose function stores this number and ends.
pub(crate) fn finished(mut b: Builder, stored: Word) -> Module {
    b.store(RESULT, stored, None, []).expect("a store");
    b.ret().expect("an end");
    b.end_function().expect("an end");
    b.module()
}

#[derive(Clone, Debug)]
enum Value {
    Number(u32),
    Members(Vec<Value>),
}

impl Value {
    fn number(&self) -> u32 {
        match self {
            Value::Number(number) => *number,
            Value::Members(members) => panic!("{members:?} is no number"),
        }
    }

    fn member(&self, path: &[Operand]) -> Value {
        path.iter().fold(self.clone(), |value, index| match value {
            Value::Members(members) => members[index.unwrap_literal_bit32() as usize].clone(),
            Value::Number(_) => panic!("a number has no members"),
        })
    }
}

/// What a module stores for a limit.
pub(crate) fn execute(module: &Module, limit: u32) -> u32 {
    let mut values: HashMap<Word, Value> = HashMap::new();
    let members = |instruction: &Instruction, values: &HashMap<Word, Value>| {
        Value::Members(instruction.operands.iter().map(|id| values[&id.unwrap_id_ref()].clone()).collect())
    };
    for constant in &module.types_global_values {
        let value = match constant.class.opcode {
            Op::Constant => Value::Number(constant.operands[0].unwrap_literal_bit32()),
            Op::ConstantTrue => Value::Number(1),
            Op::ConstantFalse => Value::Number(0),
            Op::ConstantComposite => members(constant, &values),
            _ => continue,
        };
        values.insert(constant.result_id.expect("a result"), value);
    }
    values.insert(LIMIT, Value::Number(limit));
    let blocks = &module.functions[0].blocks;
    let (mut before, mut block) = (0, &blocks[0]);
    for _ in 0..1000 {
        let entered = values.clone();
        let mut next = None;
        for instruction in &block.instructions {
            let operands = &instruction.operands;
            let id = |index: usize| id_of(instruction, index);
            let number = |index: usize| values[&id(index)].number();
            let truth = |holds: bool| Value::Number(u32::from(holds));
            let computed = match instruction.class.opcode {
                Op::Phi => {
                    let from = operands.chunks(2).find(|pair| pair[1] == Operand::IdRef(before));
                    entered[&from.expect("a value from the block before")[0].unwrap_id_ref()].clone()
                }
                Op::Load => values[&id(0)].clone(),
                Op::IAdd => Value::Number(number(0) + number(1)),
                Op::IMul => Value::Number(number(0) * number(1)),
                Op::ULessThan => truth(number(0) < number(1)),
                Op::UGreaterThanEqual => truth(number(0) >= number(1)),
                Op::INotEqual => truth(number(0) != number(1)),
                Op::CompositeExtract => values[&id(0)].member(&operands[1..]),
                Op::CompositeConstruct => members(instruction, &values),
                Op::Store => {
                    let stored = values[&id(1)].clone();
                    values.insert(id(0), stored);
                    continue;
                }
                Op::Branch => {
                    next = Some(id(0));
                    continue;
                }
                Op::BranchConditional => {
                    next = Some(if number(0) == 1 { id(1) } else { id(2) });
                    continue;
                }
                Op::LoopMerge | Op::SelectionMerge => continue,
                Op::Return => return values[&RESULT].number(),
                other => panic!("{other:?} is not in these modules"),
            };
            values.insert(instruction.result_id.expect("a result"), computed);
        }
        before = block.label_id().expect("a label");
        block = blocks.iter().find(|block| block.label_id() == next).expect("the next block");
    }
    panic!("the loop does not end")
}
