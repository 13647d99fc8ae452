//! A dispatch of every kernel on the host, made from the kernels' rows: a struct of its parameters, counts and arrays,
//! which goes to a device, runs there and comes back. What a case adds is in [`crate::case`].

use viewfuse_device::{Device, DeviceError, Element, LayerShape, Memory};
use viewfuse_kernels::rows::*;
use viewfuse_kernels::{elements, for_each_kernel};

/// An array that a kernel writes, before it runs.
#[derive(Clone, Debug)]
pub enum Output<T> {
    /// So many zeros.
    Zeros(usize),
    /// A value so many times.
    Filled(usize, T),
    /// The array of the dispatch before: several dispatches write their parts of it.
    Continued,
}

/// A layer's weights, of which a device has its own form.
#[derive(Clone, Debug)]
pub struct LayerWeights {
    /// Their sizes.
    pub shape: LayerShape,
    /// `[inner][column]`; they may be longer than the shape says.
    pub values: Vec<f32>,
}

/// An array of a dispatch, by its kind in the row.
pub trait HostArray {
    /// The same in a device's memory.
    type Loaded<D: Device>;

    /// Takes it to a device.
    fn upload<D: Device>(&self, device: &D) -> Result<Self::Loaded<D>, DeviceError>;
}

impl<T: Element> HostArray for Vec<T> {
    type Loaded<D: Device> = <D as Memory>::Buffer<T>;

    fn upload<D: Device>(&self, device: &D) -> Result<Self::Loaded<D>, DeviceError> {
        device.upload(self)
    }
}

impl<T: Element> HostArray for Option<Vec<T>> {
    type Loaded<D: Device> = Option<<D as Memory>::Buffer<T>>;

    fn upload<D: Device>(&self, device: &D) -> Result<Self::Loaded<D>, DeviceError> {
        self.as_ref().map(|values| device.upload(values)).transpose()
    }
}

impl HostArray for LayerWeights {
    type Loaded<D: Device> = D::Weights;

    fn upload<D: Device>(&self, device: &D) -> Result<Self::Loaded<D>, DeviceError> {
        device.weights(&self.shape, &self.values)
    }
}

impl<T: Element> HostArray for Output<T> {
    /// `None` if it continues another.
    type Loaded<D: Device> = Option<<D as Memory>::Buffer<T>>;

    fn upload<D: Device>(&self, device: &D) -> Result<Self::Loaded<D>, DeviceError> {
        match self {
            Output::Zeros(count) => device.zeros(*count).map(Some),
            Output::Filled(count, value) => device.upload(&vec![*value; *count]).map(Some),
            Output::Continued => Ok(None),
        }
    }
}

/// The array that the last of these dispatches writes.
///
/// # Panics
/// If the first one continues another.
pub(crate) fn current<B>(outputs: &mut [Option<B>]) -> &mut B {
    outputs.iter_mut().rev().flatten().next().expect("the first dispatch has outputs of its own")
}

/// Elements of outputs as numbers that can be compared.
trait Floats: Element {
    fn floats(values: Vec<Self>) -> Vec<f32>;
}

/// Of types that hold nothing but numbers of `f32`.
macro_rules! floats {
    ($($Type:ty),+) => { $(
        impl Floats for $Type {
            fn floats(values: Vec<$Type>) -> Vec<f32> {
                bytemuck::cast_slice(&values).to_vec()
            }
        }
    )+ };
}

floats!(f32, TargetRay, GaussianBlock, ProjectedGaussian, SplatGradient, HarmonicTerm, TermState);

impl<const N: usize> Floats for [f32; N]
where
    [f32; N]: Element,
{
    fn floats(values: Vec<[f32; N]>) -> Vec<f32> {
        values.into_flattened()
    }
}

impl Floats for u32 {
    fn floats(values: Vec<u32>) -> Vec<f32> {
        values.into_iter().map(|value| value as f32).collect()
    }
}

/// Keys: the bits of a depth, and an index.
impl Floats for [u32; 2] {
    fn floats(values: Vec<[u32; 2]>) -> Vec<f32> {
        values.into_iter().flat_map(|[depth, index]| [f32::from_bits(depth), index as f32]).collect()
    }
}

/// Numbers of steps are small enough to be exact, as are those of pictures and coefficients.
impl Floats for ParticleState {
    fn floats(values: Vec<ParticleState>) -> Vec<f32> {
        let counted = |state: ParticleState| {
            let counts = [state.step_count as f32, state.moved, state.moved_count as f32, state.rest_count as f32];
            state.moments.into_iter().flatten().chain(counts)
        };
        values.into_iter().flat_map(counted).collect()
    }
}

impl Floats for GainBlock {
    fn floats(values: Vec<GainBlock>) -> Vec<f32> {
        let counted = |gain: GainBlock| {
            let moments = gain.moments.into_iter().flatten();
            gain.value.into_iter().chain([gain.step_count as f32]).chain(moments).chain(gain.padding)
        };
        values.into_iter().flat_map(counted).collect()
    }
}

/// Numbers of samples are small enough to be exact.
impl Floats for RayPoint {
    fn floats(values: Vec<RayPoint>) -> Vec<f32> {
        let all = |RayPoint { position: [a, b, c], length, direction: [d, e, f], sample }| {
            [a, b, c, length, d, e, f, sample as f32]
        };
        values.into_iter().flat_map(all).collect()
    }
}

/// A dispatch of a kernel. The arrays of several dispatches in a device's memory are `(array of the row, ...)`, each
/// `[dispatch]`.
pub trait Dispatch: Clone + Send + Sync + 'static {
    /// The kernel.
    const KERNEL: Kernel;

    /// The arrays of several dispatches in a device's memory.
    type Loaded<D: Device>;

    /// How many elements it has, in the sense of the row.
    fn element_count(&self) -> usize;

    /// Takes the arrays of several dispatches to a device.
    fn upload<D: Device>(device: &D, dispatches: &[Self]) -> Result<Self::Loaded<D>, DeviceError>;

    /// Runs one of them.
    fn dispatch<D: Device>(&self, device: &D, loaded: &mut Self::Loaded<D>, index: usize) -> Result<(), DeviceError>;

    /// The outputs that begin with one of them, in the order of the row; none if it continues those of the one before.
    fn download<D: Device>(device: &D, loaded: &Self::Loaded<D>, index: usize) -> Result<Vec<f32>, DeviceError>;
}

/// How a dispatch holds an array of a row.
macro_rules! host {
    (layer $Host:ty) => { LayerWeights };
    (optional $Host:ty) => { Option<Vec<$Host>> };
    (write $Host:ty) => { Output<$Host> };
    (write_paged $Host:ty) => { Output<$Host> };
    ($kind:ident $Host:ty) => { Vec<$Host> };
}

/// The argument of a device's method.
macro_rules! argument {
    (optional $array:ident $index:ident) => { $array[$index].as_ref() };
    (write $array:ident $index:ident) => { current(&mut $array[..=$index]) };
    (write_paged $array:ident $index:ident) => { argument!(write $array $index) };
    ($kind:ident $array:ident $index:ident) => { &$array[$index] };
}

/// The numbers of an output.
macro_rules! download {
    (write $array:ident $index:ident $device:ident) => {
        match &$array[$index] {
            Some(buffer) => Floats::floats($device.download(buffer)?),
            None => Vec::new(),
        }
    };
    (write_paged $array:ident $index:ident $device:ident) => { download!(write $array $index $device) };
    ($kind:ident $array:ident $index:ident $device:ident) => { Vec::new() };
}

macro_rules! dispatches {
    ($({
        $Kernel:ident $method:ident
        doc { $($doc:tt)* }
        block { $($block:ident: $Block:ty)? }
        counts { $($count:ident)* }
        arrays { $({ $kind:ident $array:ident: $Host:ty, $($how:tt)* })+ }
        elements { $($elements:tt)* }
        $($rest:tt)*
    })+) => { $(
        $($doc)*
        #[derive(Clone, Debug)]
        pub struct $Kernel {
            $(
                /// The parameters.
                pub $block: $Block,
            )?
            $(
                #[doc = concat!("`", stringify!($count), "` of the row.")]
                pub $count: u32,
            )*
            $(
                #[doc = concat!("`", stringify!($array), "` of the row.")]
                pub $array: host!($kind $Host),
            )+
        }

        impl Dispatch for $Kernel {
            const KERNEL: Kernel = Kernel::$Kernel;

            type Loaded<D: Device> = ($(Vec<<host!($kind $Host) as HostArray>::Loaded<D>>,)+);

            #[allow(unused_variables)]
            fn element_count(&self) -> usize {
                $(let $block = &self.$block;)?
                $(let $count = self.$count;)*
                let elements: std::ops::Range<u32> = elements!($($elements)*);
                elements.len()
            }

            fn upload<D: Device>(device: &D, dispatches: &[Self]) -> Result<Self::Loaded<D>, DeviceError> {
                Ok(($(dispatches.iter().map(|dispatch| dispatch.$array.upload(device)).collect::<Result<_, _>>()?,)+))
            }

            fn dispatch<D: Device>(
                &self,
                device: &D,
                ($($array,)+): &mut Self::Loaded<D>,
                index: usize,
            ) -> Result<(), DeviceError> {
                device.$method($(&self.$block,)? $(self.$count,)* $(argument!($kind $array index)),+)
            }

            #[allow(unused_variables)]
            fn download<D: Device>(
                device: &D,
                ($($array,)+): &Self::Loaded<D>,
                index: usize,
            ) -> Result<Vec<f32>, DeviceError> {
                Ok([$(download!($kind $array index device)),+].concat())
            }
        }
    )+ };
}

for_each_kernel!(dispatches);
