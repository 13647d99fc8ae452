//! The grammar of a row, and the one form in which macros get rows.

/// Hands rows in their normal form to `$callback!`: only this macro knows how a row is written. A macro takes the
/// columns that it needs and leaves the rest to a `$($rest:tt)*`:
///
/// ```text
/// {
///     Variant name
///     doc { #[doc = ...] ... }
///     block { block: Parameters }                   or { }
///     counts { count ... }
///     arrays { { kind array: Element, as { vectors } at { place } unless { other block flag } } ... }
///     elements { for element in [first..end] at_least [N] }      or { tiles [rows, inner, columns] }
///     marks { mark ... }
/// }
/// ```
///
/// What is in inner braces or brackets may be missing. [`elements`](crate::elements) and [`has_mark`](crate::has_mark)
/// read their columns.
#[macro_export]
macro_rules! normal_rows {
    ($callback:ident $(
        $(#[$doc:meta])*
        $Kernel:ident $method:ident($($block:ident: $Block:ty)? $(; $($count:ident),+)?)
        $(for $element:ident in [$elements:expr $(; $least:literal a core)?])?
        $(tiles [$rows:expr, $inner:expr, $columns:expr])?
        $(, $mark:ident)* {
            $(
                $kind:ident $array:ident $([$place:expr])?: $Host:ty $(as $entry:tt)?
                $(= $other:ident if !$told:ident.$flag:ident)?
            ),+ $(,)?
        }
    )+) => {
        $callback! { $({
            $Kernel $method
            doc { $(#[$doc])* }
            block { $($block: $Block)? }
            counts { $($($count)+)? }
            arrays { $({
                $kind $array: $Host, as { $($entry)? } at { $($place)? } unless { $($other $told $flag)? }
            })+ }
            elements {
                $(for $element in [$elements] at_least [$($least)?])?
                $(tiles [$rows, $inner, $columns])?
            }
            marks { $($mark)* }
        })+ }
    };
}

/// The range of a dispatch's elements, from the column `elements` of [`normal_rows`](crate::normal_rows). Those of
/// tiles are counted in [`Form::Single`](crate::rows::Form).
#[macro_export]
macro_rules! elements {
    (for $element:ident in [$elements:expr] $($rest:tt)*) => {
        $elements
    };
    (tiles [$rows:expr, $inner:expr, $columns:expr]) => {
        0..$crate::rows::tile_elements($rows, $columns)
    };
}

/// Whether the column `marks` of [`normal_rows`](crate::normal_rows) has a mark: `has_mark!(twin: twin wide)`.
#[macro_export]
macro_rules! has_mark {
    (twin: twin $($rest:ident)*) => { true };
    (looped: looped $($rest:ident)*) => { true };
    (measured: measured $($rest:ident)*) => { true };
    (together: together $($rest:ident)*) => { true };
    ($mark:ident:) => { false };
    ($mark:ident: $other:ident $($rest:ident)*) => { $crate::has_mark!($mark: $($rest)*) };
}
