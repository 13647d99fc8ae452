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

fn kernels() -> Module {
    static KERNELS: LazyLock<Module> = LazyLock::new(|| read(&COMPILED.kernels).expect("SPIR-V"));
    KERNELS.clone()
}

fn subgroups() -> Module {
    static SUBGROUPS: LazyLock<Module> = LazyLock::new(|| read(&COMPILED.subgroups).expect("SPIR-V"));
    SUBGROUPS.clone()
}

/// Breaches of the compiled kernels with one change.
fn breaches_with(change: impl FnOnce(&mut Module)) -> Vec<String> {
    let mut module = kernels();
    change(&mut module);
    breaches(Part::Kernels, &module)
}

/// Breaches of the forms by subgroups with one change.
fn subgroup_breaches_with(change: impl FnOnce(&mut Module)) -> Vec<String> {
    let mut module = subgroups();
    change(&mut module);
    breaches(Part::Subgroups, &module)
}

/// The one breach, which says `what`.
fn assert_one(breaches: &[String], what: &str) {
    assert_eq!(breaches.len(), 1, "{breaches:?}");
    assert!(breaches[0].contains(what), "{breaches:?}");
}

/// The number of a kernel's function.
fn entry(module: &Module, kernel: Kernel) -> u32 {
    let named = |operand: &Operand| *operand == Operand::LiteralString(kernel.name().to_owned());
    let entry = module.entry_points.iter().find(|entry| named(&entry.operands[2])).expect("the entry point");
    entry.operands[1].unwrap_id_ref()
}

#[test]
fn the_kernels_are_what_the_list_says() {
    assert_eq!(breaches(Part::Kernels, &kernels()), Vec::<String>::new());
    assert_eq!(breaches(Part::Subgroups, &subgroups()), Vec::<String>::new());
}

#[test]
fn reading_and_writing_changes_nothing() {
    for bytes in [&COMPILED.kernels, &COMPILED.subgroups] {
        assert!(refine(bytes).expect("SPIR-V") == *bytes);
    }
}

#[test]
fn a_module_that_is_split_goes_to_one_side() {
    let nothing = |module: &[u8]| read(module).expect("SPIR-V").functions.is_empty();
    let Modules { kernels, subgroups } = split(&COMPILED.kernels).expect("SPIR-V");
    assert!(kernels == COMPILED.kernels && nothing(&subgroups));
    let Modules { kernels, subgroups } = split(&COMPILED.subgroups).expect("SPIR-V");
    assert!(subgroups == COMPILED.subgroups && nothing(&kernels));
    let capabilities = |bytes: &[u8]| read(bytes).expect("SPIR-V").capabilities.len();
    assert_eq!([capabilities(&kernels), capabilities(&subgroups)], [2, 5]);
    assert!(split(b"# What kernels.spv was made from").is_err());
}

#[test]
fn the_other_module_is_seen() {
    let said = breaches(Part::Kernels, &subgroups());
    assert!(said.iter().any(|said| said == "linear::subgroup: not a kernel"), "{said:?}");
    assert!(said.iter().any(|said| said == "linear::buffered: no entry point"), "{said:?}");
    let said = breaches(Part::Subgroups, &kernels());
    assert!(said.iter().any(|said| said == "linear: not a kernel"), "{said:?}");
}

#[test]
fn numbers_that_leave_a_subgroup_are_seen() {
    let shuffles = |module: &mut Module, change: &dyn Fn(&mut Instruction)| {
        for_each(module, Op::GroupNonUniformShuffle, change);
    };
    // The number of another invocation is no scope.
    let said = subgroup_breaches_with(|module| {
        let scopes: Vec<u32> = module
            .types_global_values
            .iter()
            .filter(|kind| kind.class.opcode == Op::Constant && kind.operands[0] == Operand::LiteralBit32(2))
            .filter_map(|kind| kind.result_id)
            .collect();
        shuffles(module, &|shuffle| shuffle.operands[0] = Operand::IdRef(scopes[0]));
    });
    assert!(!said.is_empty() && said.iter().all(|said| said.contains("numbers pass in scope 2")), "{said:?}");
    let is_passing = |instruction: &Instruction| {
        matches!(instruction.class.opcode, Op::GroupNonUniformShuffle | Op::GroupNonUniformBroadcast)
    };
    let said = subgroup_breaches_with(|module| {
        for block in module.functions.iter_mut().flat_map(|function| &mut function.blocks) {
            block.instructions.retain(|instruction| !is_passing(instruction));
        }
    });
    let none = entry_points(Part::Subgroups).map(|(_, _, name)| format!("{name}: 0 operations of subgroups"));
    assert_eq!(said, none.collect::<Vec<_>>());
    // One that is in the module for every device.
    let said = breaches_with(|module| {
        let entry = entry(module, Kernel::Linear);
        let function = module.functions.iter_mut().find(|function| function.def_id() == Some(entry)).expect("linear");
        let barrier = function.blocks.iter_mut().flat_map(|block| &mut block.instructions);
        let barrier = barrier.into_iter().find(|instruction| instruction.class.opcode == Op::ControlBarrier);
        let barrier = barrier.expect("a barrier");
        barrier.class = Instruction::new(Op::GroupNonUniformElect, None, None, Vec::new()).class;
        barrier.operands.truncate(1);
    });
    assert!(said.contains(&"linear: 1 operations of subgroups".to_owned()), "{said:?}");
}

#[test]
fn a_subgroup_of_another_size_than_told_is_seen() {
    let said = subgroup_breaches_with(|module| {
        let specialised = Operand::Decoration(Decoration::SpecId);
        module.annotations.retain(|annotation| annotation.operands.get(1) != Some(&specialised));
    });
    assert_eq!(said.len(), entry_points(Part::Subgroups).count(), "{said:?}");
    assert!(said.iter().all(|said| said.contains("does not use the specialisation constant")), "{said:?}");
}

#[test]
fn a_text_is_no_module() {
    assert!(read(b"# What kernels.spv was made from").is_err());
    // Cut within a function: a whole number of declarations would be a module.
    assert!(read(&COMPILED.kernels[..COMPILED.kernels.len() / 2]).is_err());
}

#[test]
fn a_wrong_workgroup_size_is_seen() {
    for axis in 2..5 {
        let said = breaches_with(|module| {
            let entry = entry(module, Kernel::SumRow);
            let mode = module.execution_modes.iter_mut().find(|mode| mode.operands[0] == Operand::IdRef(entry));
            mode.expect("a size").operands[axis] = Operand::LiteralBit32(32);
        });
        assert_one(&said, "sum_row: a workgroup");
    }
    let said = breaches_with(|module| {
        let entry = entry(module, Kernel::MarchRays);
        module.execution_modes.retain(|mode| mode.operands[0] != Operand::IdRef(entry));
    });
    assert_one(&said, "march_rays: a workgroup");
    let said = breaches_with(|module| {
        module.execution_modes[0].operands[1] = Operand::ExecutionMode(ExecutionMode::LocalSizeHint);
    });
    assert_one(&said, "a workgroup");
}

#[test]
fn a_missing_entry_point_is_seen() {
    for (_, _, name) in entry_points(Part::Kernels) {
        let said = breaches_with(|module| {
            let named = Operand::LiteralString(name.to_owned());
            module.entry_points.retain(|point| point.operands[2] != named);
        });
        assert_one(&said, &format!("{name}: no entry point"));
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
    let annotations = kernels().annotations;
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
    let said = breaches_with(|module| {
        let set = Operand::Decoration(Decoration::DescriptorSet);
        let set = module.annotations.iter_mut().find(|annotation| annotation.operands.get(1) == Some(&set));
        set.expect("a set").operands[2] = Operand::LiteralBit32(1);
    });
    // Kernels share variables that are declared alike.
    assert!(!said.is_empty() && said.iter().all(|said| said.contains("of set Some(1)")), "{said:?}");
}

#[test]
fn a_wrong_stride_is_seen() {
    let said = breaches_with(|module| {
        let sixteen = [Operand::Decoration(Decoration::ArrayStride), Operand::LiteralBit32(80)];
        let stride = module.annotations.iter_mut().find(|annotation| annotation.operands[1..] == sixteen);
        stride.expect("the stride of cameras").operands[2] = Operand::LiteralBit32(96);
    });
    let has_cameras =
        |kernel: &&Kernel| kernel.arrays().iter().any(|array| array.name == "views" && array.stride == 80);
    let views = Kernel::ALL.iter().filter(has_cameras).count();
    assert_eq!(said.len(), views, "{said:?}");
    assert!(said.iter().all(|said| said.contains("(views): Elements { stride: 96 }, not 80 bytes")), "{said:?}");
}

#[test]
fn an_array_that_could_be_written_is_seen() {
    let mark = |module: &Module| {
        let mark = Operand::Decoration(Decoration::NonWritable);
        module.annotations.iter().position(|annotation| annotation.operands.get(1) == Some(&mark)).expect("a mark")
    };
    let said = breaches_with(|module| _ = module.annotations.remove(mark(module)));
    assert!(said.iter().any(|said| said.contains("Write, not Read")), "{said:?}");
    assert!(said.iter().any(|said| said.contains("Load on binding")), "{said:?}");
}

#[test]
fn other_push_constants_are_seen() {
    let said = breaches_with(|module| {
        // Pieces of all kernels begin where their parameters end: 96 is that of cast_rays, and of march_rays.
        let second = [Operand::LiteralBit32(1), Operand::Decoration(Decoration::Offset), Operand::LiteralBit32(96)];
        let offset = module.annotations.iter_mut().find(|annotation| annotation.operands[1..] == second);
        offset.expect("the piece of rays").operands[3] = Operand::LiteralBit32(100);
    });
    assert_one(&said, "_rays: push constants [Fixed { bytes: 108 }], not 104 bytes");
}

#[test]
fn another_specialisation_constant_is_seen() {
    let change = |number: u32| {
        breaches_with(|module| {
            let specialised = Operand::Decoration(Decoration::SpecId);
            let id = module.annotations.iter_mut().find(|annotation| annotation.operands.get(1) == Some(&specialised));
            id.expect("the constant").operands[2] = Operand::LiteralBit32(number);
        })
    };
    assert_eq!(change(0), Vec::<String>::new());
    assert_one(&change(1), "specialisation constant Some(1)");
    let said = breaches_with(|module| {
        let specialised = Operand::Decoration(Decoration::SpecId);
        module.annotations.retain(|annotation| annotation.operands.get(1) != Some(&specialised));
    });
    assert_eq!(said.len(), Kernel::ALL.iter().filter(|kernel| kernel.has_pages()).count(), "{said:?}");
}

#[test]
fn a_further_capability_is_seen() {
    let said = breaches_with(|module| {
        let mut capability = module.capabilities[0].clone();
        capability.operands[0] = Operand::Capability(Capability::Int64);
        module.capabilities.push(capability);
    });
    assert_one(&said, "Int64");
    assert_one(&breaches_with(|module| _ = module.capabilities.pop()), "capabilities");
}

#[test]
fn a_composite_of_pointers_is_seen() {
    let said = breaches_with(|module| {
        let is_pointer = |kind: &&Instruction| kind.class.opcode == Op::TypePointer;
        let pointer = module.types_global_values.iter().find(is_pointer).and_then(|kind| kind.result_id);
        let members = vec![Operand::IdRef(pointer.expect("a pointer"))];
        module.types_global_values.push(Instruction::new(Op::TypeStruct, None, Some(u32::MAX), members));
    });
    assert_one(&said, "1 composites of pointers");
}

#[test]
fn arithmetic_that_could_be_contracted_is_seen() {
    let is_mark = |operands: &[Operand]| operands.get(1) == Some(&Operand::Decoration(Decoration::NoContraction));
    let mark = kernels().annotations.iter().rposition(|annotation| is_mark(&annotation.operands)).expect("a mark");
    assert_one(&breaches_with(|module| _ = module.annotations.remove(mark)), "1 results of float arithmetic");
    // Making the module anew puts it back.
    let mut module = kernels();
    module.annotations.remove(mark);
    let bytes: Vec<u8> =
        rspirv::binary::Assemble::assemble(&module).iter().flat_map(|word| word.to_le_bytes()).collect();
    let again = read(&refine(&bytes).expect("SPIR-V")).expect("SPIR-V");
    assert_eq!(breaches(Part::Kernels, &again), Vec::<String>::new());
}

#[test]
fn a_function_of_the_device_is_seen() {
    // exp of GLSL.std.450 in the place of a square root.
    let said = breaches_with(|module| {
        let mut instructions = module
            .functions
            .iter_mut()
            .flat_map(|function| &mut function.blocks)
            .flat_map(|block| &mut block.instructions);
        let call = instructions.find(|instruction| instruction.class.opcode == Op::ExtInst).expect("a square root");
        call.operands[1] = Operand::LiteralExtInstInteger(27);
    });
    assert_one(&said, "the device's function");
}

/// A change to the instructions of one operation, in all functions.
fn for_each(module: &mut Module, operation: Op, change: impl FnMut(&mut Instruction)) {
    let blocks = module.functions.iter_mut().flat_map(|function| &mut function.blocks);
    let instructions = blocks.flat_map(|block| &mut block.instructions);
    instructions.filter(|instruction| instruction.class.opcode == operation).for_each(change);
}

/// The entry points whose invocations wait for one another, in all forms.
fn waiting() -> impl Iterator<Item = &'static str> {
    entry_points(Part::Kernels).filter(|(kernel, form, _)| kernel.has_barriers(*form)).map(|(_, _, name)| name)
}

#[test]
fn memory_that_is_not_shared_is_seen() {
    for operation in [Op::Load, Op::Store] {
        let is_mark = |operand: &Operand| matches!(operand, Operand::MemoryAccess(_));
        let said =
            breaches_with(|module| for_each(module, operation, |access| access.operands.retain(|o| !is_mark(o))));
        assert_eq!(said.len(), waiting().count(), "{said:?}");
        assert!(said.iter().all(|said| said.contains("accesses to shared memory are private")), "{said:?}");
    }
}

#[test]
fn a_barrier_that_shows_nothing_is_seen() {
    let said = breaches_with(|module| {
        // The scope, 2, is no set of semantics.
        for_each(module, Op::ControlBarrier, |barrier| barrier.operands[2] = barrier.operands[0].clone());
    });
    assert!(!said.is_empty() && said.iter().all(|said| said.contains("a barrier of [2, 2, 2]")), "{said:?}");
    let said = breaches_with(|module| {
        for block in module.functions.iter_mut().flat_map(|function| &mut function.blocks) {
            block.instructions.retain(|instruction| instruction.class.opcode != Op::ControlBarrier);
        }
    });
    assert_eq!(said, waiting().map(|name| format!("{name}: 0 barriers")).collect::<Vec<_>>());
}

#[test]
fn more_memory_than_every_device_has_is_seen() {
    let said = breaches_with(|module| {
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
    });
    assert!(said.iter().any(|said| said.contains("bytes of a workgroup's memory")), "{said:?}");
}

#[test]
fn a_read_of_what_is_written_is_seen() {
    let said = breaches_with(|module| {
        let entry = entry(module, Kernel::SumRow);
        let function = module.functions.iter_mut().find(|function| function.def_id() == Some(entry)).expect("sum_row");
        let mut instructions = function.blocks.iter_mut().flat_map(|block| &mut block.instructions);
        let store = instructions.rfind(|instruction| instruction.class.opcode == Op::Store).expect("a store");
        store.class = Instruction::new(Op::Load, None, None, Vec::new()).class;
        store.result_type = Some(1);
        store.result_id = None;
        store.operands.truncate(1);
    });
    assert_one(&said, "sum_row: Load on binding Some(1)");
}
