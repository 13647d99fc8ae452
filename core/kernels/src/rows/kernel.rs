//! The list of kernels as code, from their rows.

use super::*;
use crate::network::convolve::ConvolveBlock;
use crate::network::linear::LinearBlock;
use crate::network::tile::{Shape, TILE};
use crate::pages::MAX_PAGES;
use bytemuck::{Pod, Zeroable};

/// Invocations of a workgroup, along its only axis.
pub const WORKGROUP: u32 = 64;

/// Bytes of memory that every device has for a workgroup.
pub const SHARED_BYTES: usize = 16 << 10;

/// Elements of a tiled kernel with so many outputs, counted in [`Form::Single`]: whole tiles, each invocation 8 times 8
/// outputs.
pub const fn tile_elements(row_count: u32, column_count: u32) -> u32 {
    Form::Single.elements(row_count, column_count)
}

/// How a workgroup computes a tile of a matrix product. The sums of an output run along the inner index in every form
/// of [`Form::ALL`]: the results are the same bits. Those of [`Form::ROUNDED`] and of [`Form::FUSED`] are other numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u32)]
pub enum Form {
    /// Rows and columns go through the workgroup's memory, and 64 invocations sum 8 times 8 outputs each. The
    /// definition of the others, and what small products take.
    #[default]
    Single,
    /// 128 times 64 outputs, 8 times 4 an invocation, for arrays [in fours](Form::needs_fours).
    Large,
    /// The same with 64 times 64 outputs, 4 times 4 an invocation: more workgroups, where there are fewer outputs.
    Small,
    /// The same with 32 times 32 outputs, 4 times 4 an invocation.
    Tiny,
    /// The same with 16 times 16 outputs, 4 an invocation: where a GPU would wait for what few workgroups load.
    Least,
    /// Rows pass between the invocations of a subgroup instead of through the workgroup's memory. There are no
    /// barriers. Only for devices with [subgroups that fit](Form::needs_subgroups).
    Subgroup,
    /// By a device's matrix units: the factors are rounded to f16, the sums are f32. Each factor is off by at most
    /// 2^-11 of itself, or by 2^-14 if that is more. A factor beyond 65,504 makes its outputs NaN. Only for devices
    /// with such [units](Form::needs_matrices) and arrays [in fours](Form::needs_fours).
    Half,
    /// The same in tiles of 64 times 64 outputs.
    HalfSmall,
    /// The same in tiles of 32 times 32 outputs.
    HalfTiny,
    /// The same with factors in two parts, an f16 and what is missing: each is off by at most 2^-22 of itself, or by
    /// 2^-25 if that is more, and the product of the two missing parts, at most 2^-22 of the product, is omitted.
    TwoHalves,
    /// The same in tiles of 64 times 64 outputs.
    TwoHalvesSmall,
    /// The same in tiles of 32 times 32 outputs.
    TwoHalvesTiny,
    /// The code of [`Form::Large`], in which a device may fuse a product and the sum that follows it, so that both are
    /// rounded once: an output is off by no more than two roundings of each product and sum would make it.
    Fused,
    /// The same in the tiles of [`Form::Small`].
    FusedSmall,
    /// The same in the tiles of [`Form::Tiny`].
    FusedTiny,
    /// The same in the tiles of [`Form::Least`].
    FusedLeast,
}

impl Form {
    /// The forms of two roundings that are summed in the same order, which give the same bits.
    pub const ALL: [Form; 6] = [Form::Single, Form::Large, Form::Small, Form::Tiny, Form::Least, Form::Subgroup];
    /// Those of them for arrays [in fours](Form::needs_fours), the largest tiles first.
    pub const IN_FOURS: [Form; 4] = [Form::Large, Form::Small, Form::Tiny, Form::Least];
    /// Those of them that every tiled kernel has: the others are for arrays [in fours](Form::needs_fours).
    pub const OF_ANY_ARRAYS: [Form; 2] = [Form::Single, Form::Subgroup];
    /// The forms of rounded factors, for devices with matrix units.
    pub const ROUNDED: [Form; 6] =
        [Form::Half, Form::HalfSmall, Form::HalfTiny, Form::TwoHalves, Form::TwoHalvesSmall, Form::TwoHalvesTiny];
    /// The forms of fused multiply-adds, for devices without matrix units, in the order of [`Form::IN_FOURS`].
    pub const FUSED: [Form; 4] = [Form::Fused, Form::FusedSmall, Form::FusedTiny, Form::FusedLeast];

    /// Whether a device may fuse products and sums in it.
    pub const fn may_fuse(self) -> bool {
        matches!(self, Form::Fused | Form::FusedSmall | Form::FusedTiny | Form::FusedLeast)
    }

    /// The form whose code it is: of a fused one that of two roundings, of another one itself.
    pub const fn code(self) -> Form {
        match self {
            Form::Fused => Form::Large,
            Form::FusedSmall => Form::Small,
            Form::FusedTiny => Form::Tiny,
            Form::FusedLeast => Form::Least,
            form => form,
        }
    }

    /// Whether its results are the bits of [`Form::ALL`].
    pub const fn is_exact(self) -> bool {
        !self.needs_matrices() && !self.may_fuse()
    }

    /// Rows of its tiles.
    pub const fn rows(self) -> u32 {
        match self.code() {
            Form::Large | Form::Half | Form::TwoHalves => 128,
            Form::Tiny | Form::HalfTiny | Form::TwoHalvesTiny => 32,
            Form::Least => 16,
            _ => TILE,
        }
    }

    /// Columns of its tiles.
    pub const fn columns(self) -> u32 {
        match self.code() {
            Form::Large => 64,
            form => form.rows(),
        }
    }

    /// Invocations of a workgroup.
    pub const fn invocations(self) -> u32 {
        match self.code() {
            Form::Large | Form::Small | Form::TwoHalves => 256,
            Form::Half | Form::HalfSmall | Form::HalfTiny | Form::TwoHalvesSmall | Form::TwoHalvesTiny => 128,
            _ => WORKGROUP,
        }
    }

    /// Most bytes of memory that a workgroup shares.
    pub const fn shared_bytes(self) -> usize {
        match self.code() {
            Form::TwoHalves => 3 * SHARED_BYTES,
            Form::Large | Form::Small | Form::Tiny | Form::Half | Form::TwoHalvesSmall | Form::TwoHalvesTiny => {
                2 * SHARED_BYTES
            }
            _ => SHARED_BYTES,
        }
    }

    /// Workgroups for so many outputs.
    pub const fn tiles(self, row_count: u32, column_count: u32) -> u32 {
        row_count.div_ceil(self.rows()) * column_count.div_ceil(self.columns())
    }

    /// Invocations for so many outputs: whole tiles.
    pub const fn elements(self, row_count: u32, column_count: u32) -> u32 {
        self.tiles(row_count, column_count) * self.invocations()
    }

    /// Whether it passes numbers between the invocations of a subgroup. Its entry points are in a module of their own,
    /// which only devices with these operations take. A subgroup is full and has 8 to 64 invocations, a power of two.
    pub const fn needs_subgroups(self) -> bool {
        matches!(self, Form::Subgroup)
    }

    /// Whether it multiplies by the matrix units of a device, in f16 with sums in f32. Its entry points are in a
    /// module of their own. A subgroup is full and has 32 invocations.
    pub const fn needs_matrices(self) -> bool {
        matches!(
            self,
            Form::Half
                | Form::HalfSmall
                | Form::HalfTiny
                | Form::TwoHalves
                | Form::TwoHalvesSmall
                | Form::TwoHalvesTiny
        )
    }

    /// Products of parts of factors that it takes for one product: three of factors in two parts.
    pub const fn part_products(self) -> u32 {
        match self {
            Form::TwoHalves | Form::TwoHalvesSmall | Form::TwoHalvesTiny => 3,
            _ => 1,
        }
    }

    /// Whether it reads weights as f16, two in a word ([`Kernel::PackFactors`]).
    pub const fn has_f16_weights(self) -> bool {
        matches!(self, Form::Half | Form::HalfSmall | Form::HalfTiny)
    }

    /// Whether it loads and stores whole fours: inner indices and columns are multiples of four, and all rows of its
    /// arrays begin at such ones ([`Kernel::used_in_fours`]).
    pub const fn needs_fours(self) -> bool {
        !matches!(self, Form::Single | Form::Subgroup)
    }

    /// The same numbers or others within the same bound in tiles of other sizes, the largest first: of a form that is
    /// not [exact](Form::is_exact) those, of another one itself.
    pub const fn sizes(self) -> &'static [Form] {
        match self {
            Form::Half | Form::HalfSmall | Form::HalfTiny => &[Form::Half, Form::HalfSmall, Form::HalfTiny],
            Form::TwoHalves | Form::TwoHalvesSmall | Form::TwoHalvesTiny => {
                &[Form::TwoHalves, Form::TwoHalvesSmall, Form::TwoHalvesTiny]
            }
            Form::Fused | Form::FusedSmall | Form::FusedTiny | Form::FusedLeast => &Form::FUSED,
            Form::Single => &[Form::Single],
            Form::Large => &[Form::Large],
            Form::Small => &[Form::Small],
            Form::Tiny => &[Form::Tiny],
            Form::Least => &[Form::Least],
            Form::Subgroup => &[Form::Subgroup],
        }
    }

    /// Its name in records.
    pub const fn name(self) -> &'static str {
        match self {
            Form::Single => "single",
            Form::Large => "large",
            Form::Small => "small",
            Form::Tiny => "tiny",
            Form::Least => "least",
            Form::Subgroup => "subgroup",
            Form::Half => "half",
            Form::HalfSmall => "half_small",
            Form::HalfTiny => "half_tiny",
            Form::TwoHalves => "two_halves",
            Form::TwoHalvesSmall => "two_halves_small",
            Form::TwoHalvesTiny => "two_halves_tiny",
            Form::Fused => "fused",
            Form::FusedSmall => "fused_small",
            Form::FusedTiny => "fused_tiny",
            Form::FusedLeast => "fused_least",
        }
    }
}

/// The elements of one dispatch; large work is split into several dispatches. Invocation `i` works on element
/// `first + i` if `i < count`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Piece {
    /// The first element.
    pub first: u32,
    /// How many there are.
    pub count: u32,
}

/// How a kernel accesses an array.
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
    /// As one buffer of elements.
    Whole,
    /// As one buffer with a struct of [`Array::least_bytes`] bytes.
    One,
    /// As [`MAX_PAGES`] buffers of elements.
    Pages,
}

/// An array that a kernel binds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Array {
    /// Its name in the entry point; pages add `_a` to `_d`.
    pub name: &'static str,
    /// How the kernel accesses it.
    pub access: Access,
    /// How it is bound.
    pub layout: Layout,
    /// Bytes of an element of the entry point.
    pub stride: usize,
    /// Bytes that the kernel reads without checking the length; 0 where it checks.
    pub least_bytes: usize,
    /// Whether these are a layer's weights, which some forms read as [f16](Form::has_f16_weights).
    pub is_weights: bool,
}

impl Array {
    const fn new<E>(name: &'static str, access: Access, layout: Layout) -> Array {
        Array { name, access, layout, stride: size_of::<E>(), least_bytes: 0, is_weights: false }
    }

    const fn not_empty(self) -> Array {
        Array { least_bytes: self.stride, ..self }
    }

    /// How many bindings it takes.
    pub const fn binding_count(&self) -> usize {
        match self.layout {
            Layout::Whole | Layout::One => 1,
            Layout::Pages => MAX_PAGES,
        }
    }
}

/// An array of a row.
macro_rules! array {
    ($kind:ident $name:ident $host:ty, vectors) => { array!($kind $name $host) };
    (read $name:ident $host:ty) => { Array::new::<$host>(stringify!($name), Access::Read, Layout::Whole) };
    (filled $name:ident $host:ty) => { array!(read $name $host).not_empty() };
    (layer $name:ident $host:ty) => { Array { is_weights: true, ..array!(read $name $host).not_empty() } };
    (optional $name:ident $host:ty) => { array!(read $name $host).not_empty() };
    (paged $name:ident $host:ty) => { Array::new::<$host>(stringify!($name), Access::Read, Layout::Pages) };
    (write $name:ident $host:ty) => { Array::new::<$host>(stringify!($name), Access::Write, Layout::Whole) };
    (write_paged $name:ident $host:ty) => { Array::new::<$host>(stringify!($name), Access::Write, Layout::Pages) };
    (one $name:ident $host:ty) => {
        Array {
            least_bytes: size_of::<$host>(),
            ..Array::new::<$host>(stringify!($name), Access::Read, Layout::One)
        }
    };
}

/// Bytes of a row's parameters.
macro_rules! parameter_bytes {
    () => {
        0
    };
    ($block:ident: $Block:ty) => {
        size_of::<$Block>()
    };
}

/// The matrix product that a row's parameters describe.
macro_rules! shape {
    ($bytes:ident, $block:ident: $Block:ty, tiles [$rows:expr, $inner:expr, $columns:expr]) => {{
        let $block: $Block = bytemuck::try_pod_read_unaligned($bytes).ok()?;
        Some(Shape { row_count: $rows, inner_count: $inner, column_count: $columns })
    }};
    ($($other:tt)*) => {
        None
    };
}

/// Whether elements are tiles.
macro_rules! is_tiled {
    (tiles $($shape:tt)*) => {
        true
    };
    ($($other:tt)*) => {
        false
    };
}

macro_rules! list {
    ($({
        $Kernel:ident $method:ident
        doc { $($doc:tt)* }
        block { $($block:tt)* }
        counts $counts:tt
        arrays { $({ $kind:ident $array:ident: $Host:ty, as { $($entry:tt)? } $($how:tt)* })+ }
        elements { $($elements:tt)* }
        marks { $($mark:ident)* }
    })+) => {
        /// A kernel.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(u32)]
        pub enum Kernel {
            $($($doc)* $Kernel,)+
        }

        impl Kernel {
            /// Every kernel, in the order of the data.
            pub const ALL: [Kernel; [$(stringify!($Kernel)),+].len()] = [$(Kernel::$Kernel),+];

            /// Name of its entry point, and of the method of a device that runs it.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Kernel::$Kernel => stringify!($method),)+
                }
            }

            /// Name of its entry point for a form of tiles; only tiled kernels have others than [`Form::Single`].
            pub const fn entry_point(self, form: Form) -> &'static str {
                match form.code() {
                    Form::Large => match self {
                        $(Kernel::$Kernel => concat!(stringify!($method), "::large"),)+
                    },
                    Form::Small => match self {
                        $(Kernel::$Kernel => concat!(stringify!($method), "::small"),)+
                    },
                    Form::Tiny => match self {
                        $(Kernel::$Kernel => concat!(stringify!($method), "::tiny"),)+
                    },
                    Form::Least => match self {
                        $(Kernel::$Kernel => concat!(stringify!($method), "::least"),)+
                    },
                    Form::Subgroup => match self {
                        $(Kernel::$Kernel => concat!(stringify!($method), "::subgroup"),)+
                    },
                    Form::Half => match self {
                        $(Kernel::$Kernel => concat!(stringify!($method), "::half"),)+
                    },
                    Form::HalfSmall => match self {
                        $(Kernel::$Kernel => concat!(stringify!($method), "::half_small"),)+
                    },
                    Form::HalfTiny => match self {
                        $(Kernel::$Kernel => concat!(stringify!($method), "::half_tiny"),)+
                    },
                    Form::TwoHalves => match self {
                        $(Kernel::$Kernel => concat!(stringify!($method), "::two_halves"),)+
                    },
                    Form::TwoHalvesSmall => match self {
                        $(Kernel::$Kernel => concat!(stringify!($method), "::two_halves_small"),)+
                    },
                    Form::TwoHalvesTiny => match self {
                        $(Kernel::$Kernel => concat!(stringify!($method), "::two_halves_tiny"),)+
                    },
                    _ => self.name(),
                }
            }

            /// What it binds, in the order of the bindings.
            pub const fn arrays(self) -> &'static [Array] {
                match self {
                    $(Kernel::$Kernel => const { &[$(array!($kind $array $Host $(, $entry)?)),+] },)+
                }
            }

            /// Bytes of its parameters, without the [`Piece`] behind them.
            pub const fn parameter_bytes(self) -> usize {
                match self {
                    $(Kernel::$Kernel => parameter_bytes!($($block)*),)+
                }
            }

            /// Whether its workgroups compute tiles of a matrix product.
            pub const fn is_tiled(self) -> bool {
                match self {
                    $(Kernel::$Kernel => is_tiled!($($elements)*),)+
                }
            }

            /// Whether a workgroup computes an element together, in memory that it shares.
            pub const fn is_together(self) -> bool {
                match self {
                    $(Kernel::$Kernel => crate::has_mark!(together: $($mark)*),)+
                }
            }

            /// The matrix product that a tiled kernel computes with these parameters; `None` for other kernels, and for
            /// parameters of another length.
            pub fn shape(self, parameters: &[u8]) -> Option<Shape> {
                match self {
                    $(Kernel::$Kernel => shape!(parameters, $($block)*, $($elements)*),)+
                }
            }

            /// Whether the CPU runs a faster form of its own. The body is then a definition without a caller in
            /// production on the CPU.
            pub const fn has_twin(self) -> bool {
                match self {
                    $(Kernel::$Kernel => crate::has_mark!(twin: $($mark)*),)+
                }
            }
        }
    };
}

crate::for_each_kernel!(list);

impl Kernel {
    /// The forms that give the same bits.
    pub const fn forms(self) -> &'static [Form] {
        match self {
            Kernel::Linear | Kernel::Convolve => &Form::ALL,
            _ if self.is_tiled() => &Form::OF_ANY_ARRAYS,
            _ => &[Form::Single],
        }
    }

    /// The forms of rounded factors that it has.
    pub const fn rounded_forms(self) -> &'static [Form] {
        match self {
            Kernel::Linear | Kernel::Convolve => &Form::ROUNDED,
            Kernel::RepeatProduct => &[Form::Half],
            _ => &[],
        }
    }

    /// Whether it has a form, which is not [exact](Form::is_exact).
    pub const fn has_inexact(self, form: Form) -> bool {
        match self {
            Kernel::Linear | Kernel::Convolve => !form.is_exact(),
            Kernel::RepeatProduct => matches!(form, Form::Half),
            _ => false,
        }
    }

    /// How many numbers of each array a kernel with these parameters uses, if its arrays can lie in fours, as
    /// [some forms](Form::needs_fours) need it.
    pub fn used_in_fours(self, parameters: &[u8]) -> Option<[u64; 5]> {
        match self {
            Kernel::Linear => {
                let block: LinearBlock = bytemuck::try_pod_read_unaligned(parameters).ok()?;
                block.is_in_fours().then(|| block.used())
            }
            Kernel::Convolve => {
                let block: ConvolveBlock = bytemuck::try_pod_read_unaligned(parameters).ok()?;
                block.is_in_fours().then(|| block.used())
            }
            _ => None,
        }
    }

    /// Whether invocations of a form of it wait for one another at barriers, and share memory.
    pub const fn has_barriers(self, form: Form) -> bool {
        self.is_together() || self.is_tiled() && !form.needs_subgroups()
    }

    /// How many invocations an element takes, but of a tiled kernel.
    pub const fn invocations(self) -> u32 {
        if self.is_together() { WORKGROUP } else { 1 }
    }

    /// Bytes of its push constants.
    pub const fn push_bytes(self) -> usize {
        self.parameter_bytes() + size_of::<Piece>()
    }

    /// Whether it binds pages, and so has the specialisation constant 0.
    pub fn has_pages(self) -> bool {
        self.arrays().iter().any(|array| array.layout == Layout::Pages)
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
