//! The compiled kernels are what the list of kernels says; and the checker that says so rejects what is not.

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Capability, Decoration, ExecutionMode, Op, StorageClass};
use std::sync::LazyLock;
use viewfuse_shader_compiler::refine::{read, refine};
use viewfuse_shader_compiler::split::{Modules, split};
use viewfuse_tests::contract::{Part, breaches, entry_points};
use viewfuse_tests::places::repository;
use viewfuse_vulkan::kernel::Kernel;

static COMPILED: LazyLock<Modules> = LazyLock::new(|| Modules::read(&repository()).expect("the compiled kernels"));

/// A compiled module, taken apart.
fn module(part: Part) -> Module {
    static MODULES: LazyLock<[Module; 4]> =
        LazyLock::new(|| COMPILED.named().map(|(_, bytes)| read(bytes).expect("SPIR-V")));
    MODULES[part as usize].clone()
}

/// Breaches of the compiled kernels with one change.
fn breaches_with(change: impl FnOnce(&mut Module)) -> Vec<String> {
    let mut module = module(Part::Kernels);
    change(&mut module);
    breaches(Part::Kernels, &module)
}

/// The number of a kernel's function.
fn entry(module: &Module, kernel: Kernel) -> u32 {
    let named = |operand: &Operand| *operand == Operand::LiteralString(kernel.name().to_owned());
    let entry = module.entry_points.iter().find(|entry| named(&entry.operands[2])).expect("the entry point");
    entry.operands[1].unwrap_id_ref()
}

#[test]
fn the_kernels_are_what_the_list_says() {
    for part in [Part::Kernels, Part::Subgroups, Part::Matrices, Part::StandIns] {
        assert_eq!(breaches(part, &module(part)), Vec::<String>::new(), "{part:?}");
    }
}

#[test]
fn reading_and_writing_changes_nothing() {
    for (_, bytes) in COMPILED.named() {
        assert!(refine(bytes).expect("SPIR-V") == *bytes);
    }
}

#[test]
fn a_module_that_is_split_goes_to_one_side() {
    let nothing = |module: &[u8]| read(module).expect("SPIR-V").functions.is_empty();
    let Modules { kernels, subgroups, matrices, stand_ins } = split(&COMPILED.kernels).expect("SPIR-V");
    assert!(kernels == COMPILED.kernels && [subgroups, matrices, stand_ins].iter().all(|other| nothing(other)));
    let Modules { kernels, matrices, stand_ins, .. } = split(&COMPILED.matrices).expect("SPIR-V");
    assert!(matrices == COMPILED.matrices && nothing(&kernels) && nothing(&stand_ins));
    let Modules { kernels, stand_ins, .. } = split(&COMPILED.stand_ins).expect("SPIR-V");
    assert!(stand_ins == COMPILED.stand_ins && nothing(&kernels));
    let Modules { kernels, subgroups, .. } = split(&COMPILED.subgroups).expect("SPIR-V");
    assert!(subgroups == COMPILED.subgroups && nothing(&kernels));
    let capabilities = |bytes: &[u8]| read(bytes).expect("SPIR-V").capabilities.len();
    assert_eq!([capabilities(&kernels), capabilities(&subgroups)], [2, 5]);
    assert!(split(b"# What kernels.spv was made from").is_err());
}

#[test]
fn a_text_is_no_module() {
    assert!(read(b"# What kernels.spv was made from").is_err());
    // Cut within a function: a whole number of declarations would be a module.
    assert!(read(&COMPILED.kernels[..COMPILED.kernels.len() / 2]).is_err());
}

#[test]
fn a_missing_entry_point_is_seen() {
    for (_, _, name) in entry_points(Part::Kernels) {
        let said = breaches_with(|module| {
            let named = Operand::LiteralString(name.to_owned());
            module.entry_points.retain(|point| point.operands[2] != named);
        });
        assert_eq!(said, [format!("{name}: no entry point")]);
    }
}

#[test]
fn an_entry_point_by_another_name_is_seen() {
    let said = breaches_with(|module| {
        let renamed = Operand::LiteralString("march_on".to_owned());
        let entry = entry(module, Kernel::MarchRays);
        let point = module.entry_points.iter_mut().find(|point| point.operands[1] == Operand::IdRef(entry));
        point.expect("the entry point").operands[2] = renamed;
    });
    assert_eq!(said, ["march_on: not a kernel", "march_rays: no entry point"]);
}

#[test]
fn a_missing_or_moved_binding_is_seen() {
    // Each variable in turn; kernels share those that are declared alike.
    let annotations = module(Part::Kernels).annotations;
    let is_binding = |at: &usize| annotations[*at].operands.get(1) == Some(&Operand::Decoration(Decoration::Binding));
    let mut moved = 0;
    for at in (0..annotations.len()).filter(is_binding) {
        let said = breaches_with(|module| module.annotations[at].operands[2] = Operand::LiteralBit32(99));
        let (missing, strange) = said.iter().partition::<Vec<_>, _>(|said| said.contains("is missing"));
        assert!(strange.iter().all(|said| said.contains("bindings [Some(99)] are not on the list")), "{said:?}");
        assert_eq!(missing.len(), strange.len(), "{said:?}");
        moved += missing.len();
    }
    assert_eq!(moved, entry_points(Part::Kernels).map(|(kernel, _, _)| kernel.binding_count()).sum::<usize>());
}

/// A change to the instructions of one operation, in all functions.
fn for_each(module: &mut Module, operation: Op, change: impl FnMut(&mut Instruction)) {
    let blocks = module.functions.iter_mut().flat_map(|function| &mut function.blocks);
    let instructions = blocks.flat_map(|block| &mut block.instructions);
    instructions.filter(|instruction| instruction.class.opcode == operation).for_each(change);
}

/// No instruction of one operation is left.
fn without(module: &mut Module, operation: Op) {
    let blocks = module.functions.iter_mut().flat_map(|function| &mut function.blocks);
    blocks.for_each(|block| block.instructions.retain(|instruction| instruction.class.opcode != operation));
}

/// The first annotation whose operands behind the annotated thing begin so.
fn annotation<'a>(module: &'a mut Module, operands: &[Operand]) -> &'a mut Instruction {
    let found = module.annotations.iter_mut().find(|annotation| annotation.operands[1..].starts_with(operands));
    found.expect("an annotation")
}

fn without_annotations(module: &mut Module, decoration: Decoration) {
    module.annotations.retain(|annotation| annotation.operands.get(1) != Some(&Operand::Decoration(decoration)));
}

/// A change of a module that breaks the contract in one way.
type Change = fn(&mut Module);

/// What each change is, and what is said of it.
const OF_KERNELS: [(Change, &str); 17] = [
    (
        |module| {
            let entry = Operand::IdRef(entry(module, Kernel::SumRow));
            let mode = module.execution_modes.iter_mut().find(|mode| mode.operands[0] == entry);
            mode.expect("a size").operands[3] = Operand::LiteralBit32(2);
        },
        "sum_row: a workgroup",
    ),
    (
        |module| {
            let entry = Operand::IdRef(entry(module, Kernel::MarchRays));
            module.execution_modes.retain(|mode| mode.operands[0] != entry);
        },
        "march_rays: a workgroup",
    ),
    (
        |module| module.execution_modes[0].operands[1] = Operand::ExecutionMode(ExecutionMode::LocalSizeHint),
        "a workgroup",
    ),
    (
        |module| {
            annotation(module, &[Operand::Decoration(Decoration::DescriptorSet)]).operands[2] =
                Operand::LiteralBit32(1);
        },
        "of set Some(1)",
    ),
    (
        |module| {
            let cameras = [Operand::Decoration(Decoration::ArrayStride), Operand::LiteralBit32(80)];
            annotation(module, &cameras).operands[2] = Operand::LiteralBit32(96);
        },
        "(views): Elements { stride: 96 }, not 80 bytes",
    ),
    (
        |module| {
            // Pieces of all kernels begin where their parameters end: 96 is that of cast_rays, and of march_rays.
            let second = [Operand::LiteralBit32(1), Operand::Decoration(Decoration::Offset), Operand::LiteralBit32(96)];
            annotation(module, &second).operands[3] = Operand::LiteralBit32(100);
        },
        "_rays: push constants [Fixed { bytes: 108 }], not 104 bytes",
    ),
    (
        |module| annotation(module, &[Operand::Decoration(Decoration::SpecId)]).operands[2] = Operand::LiteralBit32(1),
        "specialisation constant Some(1)",
    ),
    (|module| without_annotations(module, Decoration::SpecId), "does not use the specialisation constant"),
    (|module| _ = module.capabilities.pop(), "capabilities"),
    (
        |module| {
            let capability = Operand::Capability(Capability::Int64);
            module.capabilities.push(Instruction::new(Op::Capability, None, None, vec![capability]));
        },
        "Int64",
    ),
    (
        |module| {
            let is_pointer = |kind: &&Instruction| kind.class.opcode == Op::TypePointer;
            let pointer = module.types_global_values.iter().find(is_pointer).and_then(|kind| kind.result_id);
            let members = vec![Operand::IdRef(pointer.expect("a pointer"))];
            module.types_global_values.push(Instruction::new(Op::TypeStruct, None, Some(u32::MAX), members));
        },
        "1 composites of pointers",
    ),
    (|module| without_annotations(module, Decoration::NoContraction), "results of float arithmetic"),
    // exp of GLSL.std.450 in the place of a square root.
    (
        |module| for_each(module, Op::ExtInst, |call| call.operands[1] = Operand::LiteralExtInstInteger(27)),
        "the device's function",
    ),
    (
        |module| {
            let is_mark = |operand: &Operand| matches!(operand, Operand::MemoryAccess(_));
            for_each(module, Op::Load, |access| access.operands.retain(|operand| !is_mark(operand)));
        },
        "accesses to shared memory are private",
    ),
    // The scope, 2, is no set of semantics.
    (
        |module| for_each(module, Op::ControlBarrier, |barrier| barrier.operands[2] = barrier.operands[0].clone()),
        "a barrier of [2, 2, 2]",
    ),
    (|module| without(module, Op::ControlBarrier), ": 0 barriers"),
    (
        |module| {
            let entry = entry(module, Kernel::SumRow);
            let mut functions = module.functions.iter_mut();
            let function = functions.find(|function| function.def_id() == Some(entry)).expect("sum_row");
            let mut instructions = function.blocks.iter_mut().flat_map(|block| &mut block.instructions);
            let store = instructions.rfind(|instruction| instruction.class.opcode == Op::Store).expect("a store");
            *store = Instruction::new(Op::Load, Some(1), None, vec![store.operands[0].clone()]);
        },
        "sum_row: Load on binding Some(1)",
    ),
];

const OF_MATRICES: [(Change, &str); 3] = [
    (
        |module| {
            let is_mark = |operand: &Operand| matches!(operand, Operand::MemoryAccess(_));
            for_each(module, Op::CooperativeMatrixLoadKHR, |access| {
                access.operands.retain(|operand| !is_mark(operand))
            });
        },
        "accesses to shared memory are private",
    ),
    (|module| without(module, Op::CooperativeMatrixMulAddKHR), ": 0 matrix products"),
    (|module| _ = module.capabilities.pop(), "capabilities"),
];

const OF_SUBGROUPS: [(Change, &str); 2] = [
    (|module| without_annotations(module, Decoration::SpecId), "does not use the specialisation constant"),
    (
        |module| {
            // The number of another invocation is no scope.
            let two =
                |kind: &&Instruction| kind.class.opcode == Op::Constant && kind.operands[0] == Operand::LiteralBit32(2);
            let scope = module.types_global_values.iter().find(two).and_then(|kind| kind.result_id).expect("a 2");
            for_each(module, Op::GroupNonUniformShuffle, |shuffle| shuffle.operands[0] = Operand::IdRef(scope));
        },
        "numbers pass in scope 2",
    ),
];

#[test]
fn every_breach_is_seen_and_no_other_is_said() {
    let all = [(Part::Kernels, &OF_KERNELS[..]), (Part::Subgroups, &OF_SUBGROUPS), (Part::Matrices, &OF_MATRICES)];
    for (part, (change, what)) in all.into_iter().flat_map(|(part, all)| all.iter().map(move |one| (part, one))) {
        let mut changed = module(part);
        change(&mut changed);
        let said = breaches(part, &changed);
        assert!(!said.is_empty() && said.iter().all(|said| said.contains(what)), "{what}: {said:?}");
    }
    // The other module, and an array that could be written.
    let said = breaches(Part::Kernels, &module(Part::Subgroups));
    assert!(said.contains(&"linear::subgroup: not a kernel".to_owned()), "{said:?}");
    assert!(said.contains(&"linear: no entry point".to_owned()), "{said:?}");
    let mut module = module(Part::Kernels);
    without_annotations(&mut module, Decoration::NonWritable);
    let said = breaches(Part::Kernels, &module);
    assert!(said.iter().any(|said| said.contains("Write, not Read")), "{said:?}");
    assert!(said.iter().any(|said| said.contains("Load on binding")), "{said:?}");
}

/// Making a module anew marks its arithmetic again.
#[test]
fn arithmetic_that_could_be_contracted_is_marked() {
    let mut module = module(Part::Kernels);
    without_annotations(&mut module, Decoration::NoContraction);
    let bytes: Vec<u8> =
        rspirv::binary::Assemble::assemble(&module).iter().flat_map(|word| word.to_le_bytes()).collect();
    let again = read(&refine(&bytes).expect("SPIR-V")).expect("SPIR-V");
    assert_eq!(breaches(Part::Kernels, &again), Vec::<String>::new());
}

#[test]
fn more_memory_than_every_device_has_is_seen() {
    let mut module = module(Part::Kernels);
    let kinds = &mut module.types_global_values;
    let operands_of = |kinds: &[Instruction], id: Option<u32>| {
        let found = kinds.iter().find(|kind| kind.result_id.is_some() && kind.result_id == id);
        found.map(|kind| kind.operands.clone()).expect("what it is")
    };
    let shared = Operand::StorageClass(StorageClass::Workgroup);
    let is_shared = |kind: &&Instruction| kind.class.opcode == Op::Variable && kind.operands[0] == shared;
    let variable = kinds.iter().find(is_shared).expect("memory of a workgroup");
    let pointer = operands_of(kinds, variable.result_type);
    let length = operands_of(kinds, pointer[1].id_ref_any())[1].id_ref_any();
    let length = kinds.iter_mut().find(|kind| kind.result_id == length).expect("its length");
    length.operands[0] = Operand::LiteralBit32(1 << 20);
    let said = breaches(Part::Kernels, &module);
    assert!(said.iter().any(|said| said.contains("bytes of a workgroup's memory")), "{said:?}");
}
