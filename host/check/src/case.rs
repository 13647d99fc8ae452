//! The check of a kernel: inputs for a seed and a size, the dispatch on a device, and the expected outputs.

use super::agreement::Limits;
use super::bounded::Bounded;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_vulkan::kernel::Kernel;

/// The sizes of a kernel's check, in elements of a dispatch: one, fewer than a workgroup, one more than a
/// workgroup, several workgroups. Kernels on pictures take pictures of about as many pixels.
pub const SIZES: [u32; 5] = [1, 7, 65, 500, 2000];

/// An input by its name in [`Kernel::arrays`], or `parameters`; and a function that changes it by 1 %.
pub type Spoiler<I> = (&'static str, fn(&mut I));

/// A kernel's check.
pub trait Case {
    /// The kernel.
    const KERNEL: Kernel;
    /// The bound above which an element is undecided, and the smallest size for relative errors.
    const LIMITS: Limits;
    /// The derivation of the tolerance.
    const REASON: &'static str;
    /// Seeds of a parity test: as many as cover every shape and variant of the inputs.
    const SEED_COUNT: u64;
    /// Whether the parameters hold numbers whose change by 1 % must change the outputs; otherwise they are counts,
    /// shapes and choices, or there are none.
    const HAS_REAL_PARAMETERS: bool;
    /// Arrays of which the kernel reads only shapes: a change of 1 % changes no output.
    const SHAPES_ONLY: &'static [&'static str] = &[];
    /// One entry for each input whose change by 1 % must change the outputs.
    const SPOILERS: &'static [Spoiler<Self::Inputs>];

    /// The kernel's inputs, on the host.
    type Inputs: Clone + Send + Sync + 'static;
    /// The inputs and outputs in a device's memory.
    type Loaded<D: Device>;

    /// The inputs of a seed, for about this many elements a dispatch.
    fn inputs(seed: u64, size: u32) -> Self::Inputs;

    /// The elements of all dispatches together, in the sense of [`Kernel`].
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

    /// The outputs of all dispatches, concatenated.
    ///
    /// # Errors
    /// If the device is lost.
    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError>;

    /// The expected outputs in `f64`, with a bound for each number that holds on every device. `None` if a number
    /// depends on rounding.
    fn expected(inputs: &Self::Inputs) -> Vec<Option<Bounded>>;

    /// Upload, dispatch and download on a device.
    ///
    /// # Errors
    /// If the device fails.
    fn results<D: Device>(device: &D, inputs: &Self::Inputs) -> Result<Vec<f32>, DeviceError> {
        let mut loaded = Self::load(device, inputs)?;
        Self::run(device, inputs, &mut loaded)?;
        Self::read(device, &loaded)
    }
}

/// An operation on a kernel's case of any type.
pub trait Visitor {
    /// Its result.
    type Output;

    /// Runs it.
    fn visit<C: Case>(self) -> Self::Output;
}
