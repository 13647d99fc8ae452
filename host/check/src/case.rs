//! What is checked of a kernel: inputs for a seed and a size, how a device runs it on them, and what must come out.

use super::agreement::Limits;
use super::bounded::Bounded;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_vulkan::kernel::Kernel;

/// The sizes that a kernel is checked at, in elements of a dispatch: one, fewer than a workgroup, one more than a
/// workgroup, several workgroups. Kernels on pictures take pictures of about as many pixels.
pub const SIZES: [u32; 5] = [1, 7, 65, 500, 2000];

/// An input by name, as [`Kernel::arrays`] has it, or `parameters`; and how to put it off by 1 %.
pub type Spoiler<I> = (&'static str, fn(&mut I));

/// A kernel's check.
pub trait Case {
    /// Which kernel.
    const KERNEL: Kernel;
    /// From which bound on an element is undecided, and from which size on relative errors mean something.
    const LIMITS: Limits;
    /// Where the tolerance comes from.
    const REASON: &'static str;
    /// How many seeds a test of parity takes: as many as give every shape and variant of the inputs.
    const SEED_COUNT: u64;
    /// Whether the parameters hold numbers that a change of 1 % must show in; otherwise they are counts, shapes and
    /// choices, or there are none.
    const HAS_REAL_PARAMETERS: bool;
    /// Arrays of which the kernel takes only shapes: a change of 1 % shows nowhere.
    const SHAPES_ONLY: &'static [&'static str] = &[];
    /// One entry for each input that a change of 1 % must show in.
    const SPOILERS: &'static [Spoiler<Self::Inputs>];

    /// What the kernel reads, on the host.
    type Inputs: Clone + Send + Sync + 'static;
    /// The same in a device's memory, and what the kernel writes.
    type Loaded<D: Device>;

    /// The inputs of a seed, for about this many elements a dispatch.
    fn inputs(seed: u64, size: u32) -> Self::Inputs;

    /// How many elements, in the sense of [`Kernel`], all dispatches together have.
    fn element_count(inputs: &Self::Inputs) -> usize;

    /// Takes the inputs to a device.
    ///
    /// # Errors
    /// If the device has no memory left.
    fn load<D: Device>(device: &D, inputs: &Self::Inputs) -> Result<Self::Loaded<D>, DeviceError>;

    /// Runs the kernel, once for each dispatch.
    ///
    /// # Errors
    /// If the device is lost.
    fn run<D: Device>(device: &D, inputs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError>;

    /// What the kernel wrote, all dispatches behind one another.
    ///
    /// # Errors
    /// If the device is lost.
    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError>;

    /// What it should have written: in `f64`, with a bound for each number that holds on every device. `None` where
    /// rounding decides.
    fn expected(inputs: &Self::Inputs) -> Vec<Option<Bounded>>;

    /// All of that on a device.
    ///
    /// # Errors
    /// If the device fails.
    fn results<D: Device>(device: &D, inputs: &Self::Inputs) -> Result<Vec<f32>, DeviceError> {
        let mut loaded = Self::load(device, inputs)?;
        Self::run(device, inputs, &mut loaded)?;
        Self::read(device, &loaded)
    }
}

/// Something that is done with a kernel's case, whatever its types.
pub trait Visitor {
    /// What comes out.
    type Output;

    /// Does it.
    fn visit<C: Case>(self) -> Self::Output;
}
