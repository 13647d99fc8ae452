//! What the kernels bind.

use super::Kernel;
use viewfuse_core::attention::{EMBEDDING, FourierEmbedding};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::pages::MOST_PAGES;
use viewfuse_core::photo::ObjectBlock;
use viewfuse_core::pose::PoseBlock;
use viewfuse_core::rays::{RayPoint, TargetRay};
use viewfuse_core::weighting::MOST_WEIGHED;

/// What a kernel does with an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It only reads.
    Read,
    /// It writes each of its elements, and reads nothing that it writes.
    Write,
}

/// How an array is bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// As one buffer.
    Whole,
    /// As [`MOST_PAGES`] buffers.
    Pages,
}

/// An array that a kernel binds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Array {
    /// Its name in the entry point; pages have `_a` to `_d` behind it.
    pub name: &'static str,
    /// What is done with it.
    pub access: Access,
    /// How it is bound.
    pub layout: Layout,
    /// Bytes of an element.
    pub stride: usize,
    /// Bytes that the kernel reads without looking at the length; 0 where it looks.
    pub least_bytes: usize,
}

impl Array {
    const fn read<T>(name: &'static str) -> Array {
        Array { name, access: Access::Read, layout: Layout::Whole, stride: size_of::<T>(), least_bytes: 0 }
    }

    /// One struct `S` that is made of `T`s.
    const fn one<S, T>(name: &'static str) -> Array {
        Array { least_bytes: size_of::<S>(), ..Array::read::<T>(name) }
    }

    const fn write<T>(name: &'static str) -> Array {
        Array { access: Access::Write, ..Array::read::<T>(name) }
    }

    const fn not_empty(self) -> Array {
        Array { least_bytes: self.stride, ..self }
    }

    const fn in_pages(self) -> Array {
        Array { layout: Layout::Pages, ..self }
    }

    /// How many bindings it takes.
    pub const fn binding_count(&self) -> usize {
        match self.layout {
            Layout::Whole => 1,
            Layout::Pages => MOST_PAGES,
        }
    }
}

type Texel = [f32; 4];
type WeightRow = [f32; MOST_WEIGHED];

impl Kernel {
    /// What it binds, in the order of the bindings.
    pub const fn arrays(self) -> &'static [Array] {
        const OBJECT: Array = Array::one::<ObjectBlock, ObjectBlock>("object");
        const VIEWS: Array = Array::read::<CameraBlock>("views");
        const TEXELS: Array = Array::read::<Texel>("texels").in_pages();
        const ENTRIES: Array = Array::read::<f32>("entries").in_pages();
        const PIXELS: Array = Array::read::<u32>("pixels");
        const RAYS: Array = Array::read::<TargetRay>("rays");
        const POINTS: Array = Array::read::<RayPoint>("points");
        const SEEN: Array = Array::read::<[f32; 2]>("seen");
        const INPUTS: Array = Array::read::<f32>("inputs").not_empty();
        const WEIGHTS: Array = Array::read::<f32>("weights").not_empty();
        const BIAS: Array = Array::read::<f32>("bias").not_empty();
        const ADDEND: Array = Array::read::<f32>("addend").not_empty();
        const OUTPUTS: Array = Array::write::<f32>("outputs");
        match self {
            Kernel::Weigh => {
                const {
                    &[
                        Array::read::<PoseBlock>("sources"),
                        Array::read::<PoseBlock>("targets"),
                        Array::write::<WeightRow>("weights"),
                    ]
                }
            }
            Kernel::EmbedPose => {
                const {
                    &[
                        Array::one::<FourierEmbedding, f32>("embedding"),
                        Array::read::<PoseBlock>("poses"),
                        Array::write::<[f32; EMBEDDING]>("embedded"),
                    ]
                }
            }
            Kernel::Attend => {
                const { &[Array::read::<f32>("queries"), Array::read::<f32>("keys"), Array::write::<WeightRow>("weights")] }
            }
            Kernel::CastRays => const { &[PIXELS, Array::write::<TargetRay>("rays")] },
            Kernel::CoarseDepths => const { &[RAYS, PIXELS, Array::write::<f32>("depths")] },
            Kernel::PlacePoints => {
                const {
                    &[
                        Array::read::<u32>("samples"),
                        RAYS,
                        Array::read::<f32>("depths"),
                        Array::write::<RayPoint>("points"),
                    ]
                }
            }
            Kernel::EmbedPoints => const { &[VIEWS, POINTS, Array::write::<f32>("embedded")] },
            Kernel::VisibleWeights => {
                const { &[VIEWS, Array::read::<f32>("weights"), POINTS, Array::write::<f32>("visible")] }
            }
            Kernel::GatherLatents => {
                const { &[VIEWS, POINTS, Array::read::<f32>("grid"), ADDEND, Array::write::<f32>("gathered")] }
            }
            Kernel::GatherVolume => {
                const { &[VIEWS, POINTS, Array::read::<f32>("volume"), Array::write::<f32>("gathered")] }
            }
            Kernel::PackHalves => const { &[Array::read::<f32>("numbers"), Array::write::<u32>("words")] },
            Kernel::GatherHalves => {
                const { &[VIEWS, POINTS, Array::read::<u32>("volume"), Array::write::<f32>("gathered")] }
            }
            Kernel::Convolve => const { &[INPUTS, WEIGHTS, BIAS, ADDEND, OUTPUTS] },
            Kernel::ConvolveDepthwise => const { &[INPUTS, WEIGHTS, OUTPUTS] },
            Kernel::ConvolveTransposed => const { &[INPUTS, WEIGHTS, BIAS, OUTPUTS] },
            Kernel::MaxPool => const { &[INPUTS, OUTPUTS] },
            Kernel::Upsample => const { &[INPUTS, OUTPUTS] },
            Kernel::Product => const { &[INPUTS, WEIGHTS, BIAS, ADDEND, OUTPUTS] },
            Kernel::ChannelMeans => const { &[INPUTS, Array::write::<f32>("means")] },
            Kernel::PartMoments => const { &[INPUTS, Array::write::<[f32; 2]>("parts")] },
            Kernel::MergeMoments => const { &[Array::read::<[f32; 2]>("parts"), Array::write::<[f32; 2]>("moments")] },
            Kernel::Normalise => const { &[INPUTS, Array::read::<[f32; 2]>("moments"), WEIGHTS, BIAS, OUTPUTS] },
            Kernel::MultiplyMatrices => {
                const { &[Array::read::<f32>("left").not_empty(), Array::read::<f32>("right").not_empty(), OUTPUTS] }
            }
            Kernel::SoftmaxRows => const { &[Array::read::<f32>("scores"), Array::write::<f32>("weights")] },
            Kernel::FuseViews => {
                const { &[Array::read::<f32>("weights"), Array::read::<f32>("latents"), Array::write::<f32>("fused")] }
            }
            Kernel::Radiance => const { &[Array::read::<f32>("raw"), POINTS, Array::write::<Texel>("samples")] },
            Kernel::Composite => {
                const {
                    &[
                        Array::read::<Texel>("samples"),
                        Array::read::<f32>("sample_depths"),
                        Array::write::<Texel>("colours"),
                        Array::write::<f32>("depths"),
                    ]
                }
            }
            Kernel::WeighSamples => const { &[Array::read::<Texel>("samples"), Array::write::<[f32; 2]>("seen")] },
            Kernel::DrawChances => const { &[PIXELS, Array::write::<[f32; 2]>("chances")] },
            Kernel::FineDepths => {
                const {
                    &[
                        SEEN,
                        RAYS,
                        Array::read::<Texel>("colours"),
                        Array::read::<f32>("pixel_depths"),
                        Array::read::<[f32; 2]>("chances"),
                        Array::write::<f32>("depths"),
                    ]
                }
            }
            Kernel::MergeDepths => {
                const { &[Array::read::<f32>("coarse"), Array::read::<f32>("fine"), Array::write::<f32>("merged")] }
            }
            Kernel::WantedSamples => {
                const { &[SEEN, RAYS, PIXELS, Array::read::<f32>("depths"), Array::write::<u32>("wanted")] }
            }
            Kernel::WeighFeatures => const { &[Array::read::<f32>("raw"), POINTS, Array::write::<f32>("weights")] },
            Kernel::SumFeatures => {
                const {
                    &[
                        Array::read::<f32>("weights"),
                        Array::read::<f32>("fused"),
                        Array::read::<f32>("raw"),
                        Array::write::<f32>("summed"),
                    ]
                }
            }
            Kernel::DenoiserInput => {
                const { &[Array::read::<f32>("noisy"), Array::read::<f32>("condition"), Array::write::<f32>("inputs")] }
            }
            Kernel::HullEntry => const { &[OBJECT, VIEWS, TEXELS, Array::write::<f32>("entries").in_pages()] },
            Kernel::MatchCost => {
                const { &[OBJECT, VIEWS, TEXELS, ENTRIES, Array::read::<f32>("pair_weights"), Array::write::<f32>("costs")] }
            }
            Kernel::SumRow => const { &[Array::read::<f32>("costs"), Array::write::<[f32; 2]>("row_sums")] },
            Kernel::MeanColumn => {
                const { &[Array::read::<f32>("costs"), Array::read::<[f32; 2]>("row_sums"), Array::write::<f32>("means")] }
            }
            Kernel::PickDepth => {
                const {
                    &[
                        OBJECT,
                        VIEWS,
                        Array::read::<f32>("means"),
                        ENTRIES,
                        Array::read::<f32>("guess").in_pages(),
                        Array::write::<f32>("picked").in_pages(),
                    ]
                }
            }
            Kernel::March => {
                const {
                    &[
                        OBJECT,
                        VIEWS,
                        Array::read::<f32>("footprints"),
                        TEXELS,
                        Array::read::<f32>("depths").in_pages(),
                        Array::read::<f32>("weights"),
                        Array::write::<Texel>("colours").in_pages(),
                        Array::write::<f32>("pixel_depths").in_pages(),
                    ]
                }
            }
            Kernel::MixPictures => {
                const {
                    &[
                        Array::read::<f32>("state"),
                        Array::read::<f32>("newest"),
                        Array::read::<f32>("second"),
                        Array::read::<f32>("third"),
                        Array::read::<f32>("fourth"),
                        Array::write::<f32>("mixed"),
                    ]
                }
            }
            Kernel::AddNoise => const { &[Array::read::<f32>("picture"), Array::write::<f32>("noisy")] },
        }
    }

    /// How many bindings it has.
    pub const fn binding_count(self) -> usize {
        let arrays = self.arrays();
        let (mut count, mut index) = (0, 0);
        while index < arrays.len() {
            count += arrays[index].binding_count();
            index += 1;
        }
        count
    }
}
