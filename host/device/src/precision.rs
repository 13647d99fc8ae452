//! How precisely a layer multiplies.

use viewfuse_kernels::rows::Form;

/// The precision of a linear layer's or a convolution's products. Sums are `f32` in each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Precision {
    /// Factors are `f32`, each product and each sum is rounded once: the bits of [`Form::ALL`] on a Vulkan device.
    #[default]
    Exact,
    /// A product and the sum that follows it may be rounded once, in the order of the exact ones: [`Form::Fused`].
    Fused,
    /// Factors are two f16 each, off by at most 2^-22 of themselves or 2^-25: [`Form::TwoHalves`].
    TwoHalves,
    /// Factors are f16, off by at most 2^-11 of themselves or 2^-14: [`Form::Half`].
    Half,
}

impl Precision {
    /// Those of rounded factors, the coarsest first.
    pub const ROUNDED: [Precision; 2] = [Precision::Half, Precision::TwoHalves];

    /// The form of a kernel in which a Vulkan device computes so; `None` for exact products.
    pub const fn form(self) -> Option<Form> {
        match self {
            Precision::Exact => None,
            Precision::Fused => Some(Form::Fused),
            Precision::TwoHalves => Some(Form::TwoHalves),
            Precision::Half => Some(Form::Half),
        }
    }

    /// Its name in messages and lists.
    pub const fn name(self) -> &'static str {
        match self {
            Precision::Exact => "exact products",
            Precision::Fused => "fused products",
            Precision::TwoHalves => "products in two parts",
            Precision::Half => "products in f16",
        }
    }
}
