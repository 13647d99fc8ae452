//! The check of a kernel: the dispatches for a seed and a size, and their expected outputs.

use super::agreement::Limits;
use super::bounded::Bounded;
use super::dispatch::Dispatch;
use viewfuse_device::{Device, DeviceError};

/// The sizes of a kernel's check, in elements of a dispatch: one, fewer than a workgroup, one more than a
/// workgroup, several workgroups. Kernels on pictures take pictures of about as many pixels.
pub const SIZES: [u32; 5] = [1, 7, 65, 500, 2000];

/// An input by its name in [`Kernel::arrays`](viewfuse_vulkan::kernel::Kernel::arrays), or `parameters`; and a function
/// that changes it by 1 %.
pub type NegativeControl<C> = (&'static str, fn(&mut C));

/// A kernel's check. Its inputs are dispatches as the kernel's row makes them.
pub trait Case: Dispatch {
    /// The bound above which an element is undecided, and the smallest size for relative errors.
    const LIMITS: Limits;
    /// The derivation of the tolerance.
    const REASON: &'static str;
    /// Seeds of a parity test: as many as cover every shape and variant of the inputs.
    const SEED_COUNT: u64 = 4;
    /// Whether the parameters hold numbers whose change by 1 % must change the outputs; otherwise they are counts,
    /// shapes and choices, or there are none.
    const HAS_REAL_PARAMETERS: bool = true;
    /// Arrays of which the kernel reads only shapes: a change of 1 % changes no output.
    const SHAPES_ONLY: &'static [&'static str] = &[];
    /// One entry for each input whose change by 1 % in all dispatches must change the outputs.
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>];

    /// The dispatches of a seed, for about this many elements each.
    fn inputs(seed: u64, size: u32) -> Vec<Self>;

    /// The expected outputs in `f64`, with a bound for each number that holds on every device. `None` if a number
    /// depends on rounding. A dispatch that continues the outputs of the one before adds its part to that one's.
    fn expected(&self) -> Vec<Option<Bounded>>;

    /// Runs one of several dispatches. A case whose arrays share a buffer has its own way.
    fn run_one<D: Device>(&self, device: &D, loaded: &mut Self::Loaded<D>, index: usize) -> Result<(), DeviceError> {
        self.dispatch(device, loaded, index)
    }

    /// The outputs that begin with one of several dispatches. A case whose outputs are no plain numbers has its own
    /// way.
    fn read_one<D: Device>(device: &D, loaded: &Self::Loaded<D>, index: usize) -> Result<Vec<f32>, DeviceError> {
        Self::download(device, loaded, index)
    }

    /// Runs all dispatches.
    fn run<D: Device>(device: &D, inputs: &[Self], loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        inputs.iter().enumerate().try_for_each(|(index, dispatch)| dispatch.run_one(device, loaded, index))
    }

    /// The outputs of all dispatches, concatenated.
    fn read<D: Device>(device: &D, inputs: &[Self], loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let mut values = Vec::new();
        for index in 0..inputs.len() {
            values.extend(Self::read_one(device, loaded, index)?);
        }
        Ok(values)
    }

    /// Upload, dispatch and download on a device.
    fn results<D: Device>(device: &D, inputs: &[Self]) -> Result<Vec<f32>, DeviceError> {
        let mut loaded = Self::upload(device, inputs)?;
        Self::run(device, inputs, &mut loaded)?;
        Self::read(device, inputs, &loaded)
    }

    /// The expected outputs of all dispatches, concatenated.
    fn all_expected(inputs: &[Self]) -> Vec<Option<Bounded>> {
        inputs.iter().flat_map(Self::expected).collect()
    }
}

/// An operation on a kernel's case of any type.
pub trait Visitor {
    /// Its result.
    type Output;

    /// Runs it.
    fn visit<C: Case>(self) -> Self::Output;
}
