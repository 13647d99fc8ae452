//! Whether a compiled module is what the list of kernels says: the checker.

use crate::module::{Content, Declarations, id_of, instructions};
use rspirv::dr::{Function, Module, Operand};
use rspirv::spirv::{
    AddressingModel, Capability, Decoration, ExecutionMode, ExecutionModel, MemoryAccess, MemoryModel, MemorySemantics,
    Op, Scope, StorageClass, Word,
};
use std::collections::{BTreeMap, BTreeSet};
use viewfuse_vulkan::kernel::{Access, Array, Form, Kernel, Layout};

/// `Sqrt` of `GLSL.std.450`: the only function that is the device's.
const SQUARE_ROOT: u32 = 31;
/// `PackHalf2x16`, of numbers that are rounded already: with matrix units, which have f16 themselves.
const PACK_HALVES: u32 = 58;

/// What a barrier has to say: what was written is there, and is seen.
const SHARING: MemorySemantics = MemorySemantics::ACQUIRE_RELEASE
    .union(MemorySemantics::WORKGROUP_MEMORY)
    .union(MemorySemantics::MAKE_AVAILABLE)
    .union(MemorySemantics::MAKE_VISIBLE);

/// Which module: what a device must have for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The kernels for every device.
    Kernels,
    /// The forms that need operations of subgroups.
    Subgroups,
    /// The forms that need matrix units.
    Matrices,
    /// What stands in for these in tests.
    StandIns,
}

impl Part {
    /// What a device must have for it.
    fn capabilities(self) -> &'static [Capability] {
        match self {
            Part::Kernels | Part::StandIns => &[Capability::Shader, Capability::VulkanMemoryModel],
            Part::Matrices => &[
                Capability::Shader,
                Capability::VulkanMemoryModel,
                Capability::Float16,
                Capability::GroupNonUniform,
                Capability::CooperativeMatrixKHR,
            ],
            Part::Subgroups => &[
                Capability::Shader,
                Capability::VulkanMemoryModel,
                Capability::GroupNonUniform,
                Capability::GroupNonUniformBallot,
                Capability::GroupNonUniformShuffle,
            ],
        }
    }

    /// The number of its specialisation constant: a page's length, or the size of a subgroup.
    fn constant(self) -> u32 {
        match self {
            Part::Subgroups => 1,
            _ => 0,
        }
    }

    /// Whether its entry points compute by matrix units, or by what stands in for them.
    fn is_rounded(self) -> bool {
        matches!(self, Part::Matrices | Part::StandIns)
    }

    /// The functions of the device that it may call.
    fn functions(self) -> &'static [u32] {
        if self.is_rounded() { &[SQUARE_ROOT, PACK_HALVES] } else { &[SQUARE_ROOT] }
    }
}

/// Every breach as a sentence, none if the module is what [`Kernel::ALL`] says of its part.
pub fn breaches(part: Part, module: &Module) -> Vec<String> {
    let mut breaches = Breaches { part, declarations: Declarations::new(module), said: Vec::new() };
    breaches.look_at_header(module);
    let mut entries = BTreeMap::new();
    for entry in &module.entry_points {
        let name = entry.operands[2].unwrap_literal_string().to_owned();
        breaches.unless(entry.operands[0] == Operand::ExecutionModel(ExecutionModel::GLCompute), || {
            format!("{name}: not a compute shader")
        });
        breaches.unless(entry_points(part).any(|(_, _, known)| known == name), || format!("{name}: not a kernel"));
        let double = entries.insert(name.clone(), id_of(entry, 1));
        breaches.unless(double.is_none(), || format!("{name}: two entry points"));
    }
    for (kernel, form, name) in entry_points(part) {
        match entries.get(&name) {
            Some(entry) => breaches.look_at_kernel(module, (kernel, form), &name, *entry),
            None => breaches.said.push(format!("{name}: no entry point")),
        }
    }
    breaches.look_at_arithmetic(module);
    breaches.said
}

/// Every entry point that should be in a module: one for each kernel and form.
pub fn entry_points(part: Part) -> impl Iterator<Item = (Kernel, Form, String)> {
    let forms = move |kernel: Kernel| if part.is_rounded() { kernel.rounded_forms() } else { kernel.forms() };
    let end = if part == Part::StandIns { "_stand_in" } else { "" };
    let name = move |kernel: Kernel, form: Form| kernel.entry_point(form).to_owned() + end;
    let of_kernel = move |kernel: Kernel| forms(kernel).iter().map(move |form| (kernel, *form, name(kernel, *form)));
    let is_here = move |(_, form, _): &(Kernel, Form, String)| form.needs_subgroups() == (part == Part::Subgroups);
    Kernel::ALL.into_iter().flat_map(of_kernel).filter(is_here)
}

struct Breaches<'a> {
    part: Part,
    declarations: Declarations<'a>,
    said: Vec<String>,
}

impl Breaches<'_> {
    fn unless(&mut self, holds: bool, say: impl FnOnce() -> String) {
        if !holds {
            self.said.push(say());
        }
    }

    fn look_at_header(&mut self, module: &Module) {
        let version = module.header.as_ref().map(|header| header.version());
        self.unless(version.is_some_and(|version| version <= (1, 3)), || {
            format!("version {version:?}: Vulkan 1.1 reads SPIR-V up to 1.3")
        });
        let capabilities: BTreeSet<String> =
            module.capabilities.iter().map(|capability| format!("{:?}", capability.operands[0])).collect();
        let allowed: BTreeSet<String> = self
            .part
            .capabilities()
            .iter()
            .map(|capability| format!("{:?}", Operand::Capability(*capability)))
            .collect();
        self.unless(capabilities == allowed, || format!("capabilities {capabilities:?}, not {allowed:?}"));
        for extension in &module.extensions {
            let name = extension.operands[0].unwrap_literal_string();
            let is_of_matrices = self.part == Part::Matrices && name == "SPV_KHR_cooperative_matrix";
            self.unless(name == "SPV_KHR_vulkan_memory_model" || is_of_matrices, || format!("extension {name}"));
        }
        let model = module.memory_model.as_ref().map(|model| model.operands.clone());
        let logical = Operand::AddressingModel(AddressingModel::Logical);
        self.unless(model == Some(vec![logical, Operand::MemoryModel(MemoryModel::Vulkan)]), || {
            format!("memory model {model:?}")
        });
        let names = module.debug_string_source.len() + module.debug_names.len() + module.debug_module_processed.len();
        self.unless(names == 0, || format!("{names} names of things or files"));
        let is_pointer = |id: Word| self.declarations.definition(id).class.opcode == Op::TypePointer;
        let of_pointers = module.types_global_values.iter().filter(|kind| {
            matches!(kind.class.opcode, Op::TypeStruct | Op::TypeArray)
                && kind.operands.iter().filter_map(Operand::id_ref_any).any(is_pointer)
        });
        let of_pointers = of_pointers.count();
        self.unless(of_pointers == 0, || format!("{of_pointers} composites of pointers, where addressing is logical"));
        for constant in &module.types_global_values {
            let number = constant.result_id.and_then(|id| self.declarations.decorated(id, Decoration::SpecId));
            let known = self.part.constant();
            self.unless(number.is_none_or(|number| number == known), || format!("specialisation constant {number:?}"));
            if number == Some(known) {
                let kind = self.declarations.definition(constant.result_type.expect("a constant's type"));
                let is_u32 = kind.class.opcode == Op::TypeInt && kind.operands[0] == Operand::LiteralBit32(32);
                // The size of a subgroup is always told.
                let is_told = known > 0 || constant.operands[0] == Operand::LiteralBit32(0);
                self.unless(is_u32 && is_told, || {
                    "the specialisation constant is not a u32 that is 0 unless told".to_owned()
                });
            }
        }
    }

    fn look_at_kernel(&mut self, module: &Module, (kernel, form): (Kernel, Form), name: &str, entry: Word) {
        let sizes: Vec<&[Operand]> = module
            .execution_modes
            .iter()
            .filter(|mode| mode.operands[0] == Operand::IdRef(entry))
            .map(|mode| &mode.operands[1..])
            .collect();
        let invocations = form.invocations();
        let size = [invocations, 1, 1].map(Operand::LiteralBit32);
        let size = [&[Operand::ExecutionMode(ExecutionMode::LocalSize)], &size[..]].concat();
        self.unless(sizes == [&size[..]], || format!("{name}: a workgroup is {sizes:?}, not {invocations}"));

        let functions = self.declarations.functions(entry);
        let used = self.declarations.used(&functions);
        let of_class = |class: StorageClass| -> Vec<Word> {
            used.iter().copied().filter(|id| self.declarations.storage_class(*id) == Some(class)).collect()
        };
        let buffers = of_class(StorageClass::StorageBuffer);
        let shared = of_class(StorageClass::Workgroup);
        let pushed: Vec<Content> =
            of_class(StorageClass::PushConstant).iter().map(|push| self.declarations.content(*push)).collect();
        let specialised = used.iter().any(|id| self.declarations.is_decorated(*id, Decoration::SpecId));
        let foreign = [StorageClass::Uniform, StorageClass::UniformConstant]
            .into_iter()
            .find(|class| !of_class(*class).is_empty());
        self.unless(foreign.is_none(), || format!("{name}: uses {foreign:?}"));
        self.unless(pushed == [Content::Fixed { bytes: kernel.push_bytes() }], || {
            format!("{name}: push constants {pushed:?}, not {} bytes", kernel.push_bytes())
        });
        self.unless(specialised == (kernel.has_pages() || form.needs_subgroups()), || {
            format!("{name}: {} the specialisation constant", if specialised { "uses" } else { "does not use" })
        });
        self.look_at_buffers((kernel, form), name, &buffers);
        self.look_at_accesses(name, &functions);
        let most = if kernel.has_barriers(form) { form.shared_bytes() } else { 0 };
        self.look_at_sharing(most, name, &shared, &functions);
        self.look_at_subgroups(name, &functions);
        self.look_at_matrices(name, &functions);
    }

    fn look_at_buffers(&mut self, (kernel, form): (Kernel, Form), name: &str, buffers: &[Word]) {
        let mut bound = BTreeMap::new();
        for buffer in buffers {
            let set = self.declarations.decorated(*buffer, Decoration::DescriptorSet);
            self.unless(set == Some(0), || format!("{name}: a buffer of set {set:?}"));
            let binding = self.declarations.decorated(*buffer, Decoration::Binding);
            let double = bound.insert(binding, *buffer);
            self.unless(double.is_none(), || format!("{name}: binding {binding:?} is bound twice"));
        }
        let wanted = kernel.arrays().iter().flat_map(|array| std::iter::repeat_n(array, array.binding_count()));
        for (number, array) in wanted.enumerate() {
            let Some(buffer) = bound.remove(&Some(number as u32)) else {
                self.said.push(format!("{name}: binding {number} ({}) is missing", array.name));
                continue;
            };
            let access = match self.declarations.is_decorated(buffer, Decoration::NonWritable) {
                true => Access::Read,
                false => Access::Write,
            };
            self.unless(access == array.access, || {
                format!("{name}: binding {number} ({}): {access:?}, not {:?}", array.name, array.access)
            });
            let content = self.declarations.content(buffer);
            self.unless(content == wanted_content(array, form), || {
                format!("{name}: binding {number} ({}): {content:?}, not {} bytes", array.name, array.stride)
            });
        }
        self.unless(bound.is_empty(), || format!("{name}: bindings {:?} are not on the list", bound.keys()));
    }

    /// Reads and writes go where the list says: what is written is never read.
    fn look_at_accesses(&mut self, name: &str, functions: &[&Function]) {
        for instruction in functions.iter().flat_map(|function| instructions(function)) {
            let operation = instruction.class.opcode;
            if !matches!(operation, Op::Load | Op::Store | Op::CopyMemory | Op::ArrayLength)
                && !format!("{operation:?}").starts_with("Atomic")
            {
                continue;
            }
            let variable = self.declarations.variable_behind(id_of(instruction, 0));
            if self.declarations.storage_class(variable) != Some(StorageClass::StorageBuffer) {
                continue;
            }
            let is_read_only = self.declarations.is_decorated(variable, Decoration::NonWritable);
            let binding = self.declarations.decorated(variable, Decoration::Binding);
            let holds = match operation {
                Op::Load => is_read_only,
                Op::Store => !is_read_only,
                Op::ArrayLength => true,
                _ => false,
            };
            self.unless(holds, || format!("{name}: {operation:?} on binding {binding:?}, read only: {is_read_only}"));
        }
    }

    /// Matrices are multiplied in their own module alone, and all of it by them.
    fn look_at_matrices(&mut self, name: &str, functions: &[&Function]) {
        let all = functions.iter().flat_map(|function| instructions(function));
        let products = all.filter(|instruction| instruction.class.opcode == Op::CooperativeMatrixMulAddKHR).count();
        self.unless((products > 0) == (self.part == Part::Matrices), || format!("{name}: {products} matrix products"));
    }

    /// Numbers pass between invocations only within a subgroup, and only in the module for devices that can do that.
    fn look_at_subgroups(&mut self, name: &str, functions: &[&Function]) {
        let mut passed = 0;
        for instruction in functions.iter().flat_map(|function| instructions(function)) {
            if format!("{:?}", instruction.class.opcode).starts_with("GroupNonUniform") {
                passed += 1;
                let scope = self.declarations.constant(id_of(instruction, 0));
                self.unless(scope == Scope::Subgroup as u32, || format!("{name}: numbers pass in scope {scope}"));
            }
        }
        self.unless((passed > 0) == (self.part == Part::Subgroups), || {
            format!("{name}: {passed} operations of subgroups")
        });
    }

    /// Tiles, and elements that a workgroup computes together, are computed in memory that the workgroup really shares;
    /// other kernels have none, and wait for nobody.
    fn look_at_sharing(&mut self, most: usize, name: &str, shared: &[Word], functions: &[&Function]) {
        let bytes: usize = shared.iter().map(|variable| self.declarations.variable_bytes(*variable)).sum();
        let is_sharing = most > 0;
        self.unless((bytes > 0) == is_sharing && bytes <= most, || {
            format!("{name}: {bytes} bytes of a workgroup's memory")
        });
        let (mut private, mut barriers) = (0, 0);
        for instruction in functions.iter().flat_map(|function| instructions(function)) {
            match instruction.class.opcode {
                Op::Load | Op::Store | Op::CooperativeMatrixLoadKHR | Op::CooperativeMatrixStoreKHR => {
                    let is_shared = self.declarations.is_pointer_to(id_of(instruction, 0), StorageClass::Workgroup);
                    let marked = |operand: &Operand| {
                        matches!(operand, Operand::MemoryAccess(access)
                            if access.contains(MemoryAccess::NON_PRIVATE_POINTER))
                    };
                    private += usize::from(is_shared && !instruction.operands.iter().any(marked));
                }
                Op::ControlBarrier => {
                    barriers += 1;
                    let said = [0, 1, 2].map(|operand| self.declarations.constant(id_of(instruction, operand)));
                    let workgroup = Scope::Workgroup as u32;
                    self.unless(said == [workgroup, workgroup, SHARING.bits()], || {
                        format!("{name}: a barrier of {said:?}")
                    });
                }
                _ => {}
            }
        }
        self.unless(private == 0, || format!("{name}: {private} accesses to shared memory are private"));
        self.unless((barriers > 0) == is_sharing, || format!("{name}: {barriers} barriers"));
    }

    fn look_at_arithmetic(&mut self, module: &Module) {
        let mut unmarked = 0;
        for instruction in module.functions.iter().flat_map(instructions) {
            let result = instruction.result_id.unwrap_or_default();
            let operation = instruction.class.opcode;
            if is_float_arithmetic(operation) && !self.declarations.is_decorated(result, Decoration::NoContraction) {
                unmarked += 1;
            }
            if operation == Op::ExtInst {
                let function = &instruction.operands[1];
                let known = self.part.functions().iter().copied().map(Operand::LiteralExtInstInteger);
                self.unless(known.into_iter().any(|known| known == *function), || {
                    format!("the device's function {function:?}, where core has its own")
                });
            }
        }
        self.unless(unmarked == 0, || format!("{unmarked} results of float arithmetic are not NoContraction"));
    }
}

/// What a binding should hold. Structs that exist once are no arrays.
fn wanted_content(array: &Array, form: Form) -> Content {
    match array.layout {
        // Four numbers, too.
        Layout::Whole if form.has_f16_weights() && array.is_weights => Content::Elements { stride: 2 * array.stride },
        Layout::Whole if form.needs_fours() => Content::Elements { stride: 4 * array.stride },
        Layout::One => Content::Fixed { bytes: array.least_bytes },
        Layout::Whole | Layout::Pages => Content::Elements { stride: array.stride },
    }
}

/// Operations whose results a device may fuse with others. Written down here again on purpose: the checker does not
/// believe the compiler's list.
fn is_float_arithmetic(operation: Op) -> bool {
    let name = format!("{operation:?}");
    ["FNegate", "FAdd", "FSub", "FMul", "FDiv", "FRem", "FMod", "Dot", "OuterProduct"].contains(&name.as_str())
        || name.contains("Times")
}
