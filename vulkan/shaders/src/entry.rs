//! Rows to entry points.
//!
//! rust-gpu reads its attributes as they stand in the source, so that bindings are numbered from a list of literals. An
//! entry point without a name of its own has that of its function's path in the crate.

/// The entry points of all rows.
macro_rules! entries {
    ($({
        $Kernel:ident $method:ident
        doc { $($doc:tt)* }
        block { $($block:tt)* }
        counts $counts:tt
        arrays { $({ $kind:ident $array:ident: $Host:ty, as { $($entry:tt)? } $($how:tt)* })+ }
        elements { $($elements:tt)* }
        marks { $($mark:ident)* }
    })+) => {
        $(entry! {
            { [$($doc)*] $method { $($block)* } { $($elements)* } { $($mark)* } }
            [] [] []
            [$({ $kind $array: $Host $(, $entry)? })+]
            [0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23]
        })+
    };
}

/// The entry points of a row. What stands in brackets is the function's parameters, the pages that it puts together and
/// the arguments of the body so far; then the arrays that are left, and the numbers of bindings that are left.
macro_rules! entry {
    // Of tiled kernels all arrays are read and written without a panic.
    (
        { $doc:tt $method:ident $block:tt { tiles $shape:tt } $marks:tt } [$($parameters:tt)*] [] [$($arguments:tt)*]
        [{ write $array:ident: $Host:ty } $($more:tt)*] [$binding:literal $($bindings:literal)*]
    ) => {
        entry! {
            { $doc $method $block { tiles $shape } $marks }
            [$($parameters)* #[spirv(storage_buffer, descriptor_set = 0, binding = $binding)] $array: &mut [$Host],]
            [] [$($arguments)* Unchecked($array),] [$($more)*] [$($bindings)*]
        }
    };
    (
        { $doc:tt $method:ident $block:tt { tiles $shape:tt } $marks:tt } [$($parameters:tt)*] [] [$($arguments:tt)*]
        [{ $kind:ident $array:ident: $Host:ty } $($more:tt)*] [$binding:literal $($bindings:literal)*]
    ) => {
        entry! {
            { $doc $method $block { tiles $shape } $marks }
            [$($parameters)* #[spirv(storage_buffer, descriptor_set = 0, binding = $binding)] $array: &[$Host],]
            [] [$($arguments)* Endless($array),] [$($more)*] [$($bindings)*]
        }
    };
    // Nor of those that a workgroup computes together.
    (
        { $doc:tt $method:ident $block:tt $elements:tt { together $($mark:ident)* } } [$($parameters:tt)*] [] [$($arguments:tt)*]
        [{ $kind:ident $array:ident: $Host:ty $(, $entry:tt)? } $($more:tt)*] [$binding:literal $($bindings:literal)*]
    ) => {
        entry! {
            { $doc $method $block $elements { together $($mark)* } }
            [$($parameters)*
                #[spirv(storage_buffer, descriptor_set = 0, binding = $binding)] $array: bound!($kind $Host $(,
                    $entry)?),
            ]
            [] [$($arguments)* unchecked!($kind $array $(, $entry)?),] [$($more)*] [$($bindings)*]
        }
    };
    // Pages.
    (
        $row:tt [$($parameters:tt)*] [$($pages:tt)*] [$($arguments:tt)*]
        [{ paged $array:ident: $Host:ty $(, $entry:tt)? } $($more:tt)*]
        [$first:literal $second:literal $third:literal $fourth:literal $($bindings:literal)*]
    ) => {
        entry! {
            $row
            [$($parameters)*
                #[spirv(storage_buffer, descriptor_set = 0, binding = $first)] a: bound!(paged $Host $(, $entry)?),
                #[spirv(storage_buffer, descriptor_set = 0, binding = $second)] b: bound!(paged $Host $(, $entry)?),
                #[spirv(storage_buffer, descriptor_set = 0, binding = $third)] c: bound!(paged $Host $(, $entry)?),
                #[spirv(storage_buffer, descriptor_set = 0, binding = $fourth)] d: bound!(paged $Host $(, $entry)?),
            ]
            [$($pages)* { Pages [] $array a b c d }] [$($arguments)* lent!(paged $array $(, $entry)?),]
            [$($more)*] [$($bindings)*]
        }
    };
    (
        $row:tt [$($parameters:tt)*] [$($pages:tt)*] [$($arguments:tt)*]
        [{ write_paged $array:ident: $Host:ty $(, $entry:tt)? } $($more:tt)*]
        [$first:literal $second:literal $third:literal $fourth:literal $($bindings:literal)*]
    ) => {
        entry! {
            $row
            [$($parameters)*
                #[spirv(storage_buffer, descriptor_set = 0, binding = $first)] a: bound!(write $Host $(, $entry)?),
                #[spirv(storage_buffer, descriptor_set = 0, binding = $second)] b: bound!(write $Host $(, $entry)?),
                #[spirv(storage_buffer, descriptor_set = 0, binding = $third)] c: bound!(write $Host $(, $entry)?),
                #[spirv(storage_buffer, descriptor_set = 0, binding = $fourth)] d: bound!(write $Host $(, $entry)?),
            ]
            [$($pages)* { PagesMut [mut] $array a b c d }] [$($arguments)* lent!(write_paged $array $(, $entry)?),]
            [$($more)*] [$($bindings)*]
        }
    };
    // One binding: its type, and how the body gets it.
    (
        $row:tt [$($parameters:tt)*] $pages:tt [$($arguments:tt)*]
        [{ $kind:ident $array:ident: $Host:ty $(, $entry:tt)? } $($more:tt)*] [$binding:literal $($bindings:literal)*]
    ) => {
        entry! {
            $row
            [$($parameters)*
                #[spirv(storage_buffer, descriptor_set = 0, binding = $binding)] $array: bound!($kind $Host $(,
                    $entry)?),
            ]
            $pages [$($arguments)* lent!($kind $array $(, $entry)?),] [$($more)*] [$($bindings)*]
        }
    };
    // The functions.
    (
        { [$($doc:tt)*] $method:ident { $block:ident: $Block:ty } { for $($elements:tt)* } { together $($mark:ident)* } }
        [$($parameters:tt)*] [] [$($arguments:tt)*] [] $bindings:tt
    ) => {
        $($doc)*
        #[spirv(compute(threads(64)))]
        #[allow(clippy::too_many_arguments)]
        pub fn $method(
            #[spirv(global_invocation_id)] id: UVec3,
            #[spirv(push_constant)] push: &Push<$Block>,
            $($parameters)*
            #[spirv(workgroup)] shared: &mut [u32; shared_words!($method)],
        ) {
            bodies::together::$method(&push.parameters, $($arguments)* Together(shared), push.piece.first + id.x);
        }
    };
    (
        { [$($doc:tt)*] $method:ident {} { for $($elements:tt)* } { $($mark:ident)* } }
        [$($parameters:tt)*] [] [$($arguments:tt)*] [] $bindings:tt
    ) => {
        $($doc)*
        #[spirv(compute(threads(64)))]
        pub fn $method(
            #[spirv(global_invocation_id)] id: UVec3,
            #[spirv(push_constant)] piece: &Piece,
            $($parameters)*
        ) {
            if id.x < piece.count {
                bodies::$method($($arguments)* piece.first + id.x);
            }
        }
    };
    (
        { [$($doc:tt)*] $method:ident { $block:ident: $Block:ty } { for $($elements:tt)* } { $($mark:ident)* } }
        [$($parameters:tt)*] [] [$($arguments:tt)*] [] $bindings:tt
    ) => {
        $($doc)*
        #[spirv(compute(threads(64)))]
        #[allow(clippy::too_many_arguments)]
        pub fn $method(
            #[spirv(global_invocation_id)] id: UVec3,
            #[spirv(push_constant)] push: &Push<$Block>,
            $($parameters)*
        ) {
            if id.x < push.piece.count {
                bodies::$method(&push.parameters, $($arguments)* push.piece.first + id.x);
            }
        }
    };
    (
        { [$($doc:tt)*] $method:ident { $block:ident: $Block:ty } { for $($elements:tt)* } { $($mark:ident)* } }
        [$($parameters:tt)*] [$({ $Pages:ident [$($mut:tt)?] $array:ident $a:ident $b:ident $c:ident $d:ident })+]
        [$($arguments:tt)*] [] $bindings:tt
    ) => {
        $($doc)*
        #[spirv(compute(threads(64)))]
        #[allow(clippy::too_many_arguments)]
        pub fn $method(
            #[spirv(global_invocation_id)] id: UVec3,
            #[spirv(push_constant)] push: &Push<$Block>,
            $($parameters)*
            #[spirv(spec_constant(id = 0, default = 0))] page_shift: u32,
        ) {
            if id.x < push.piece.count {
                $(let $($mut)? $array = $Pages { a: $a, b: $b, c: $c, d: $d, shift: page_shift };)+
                bodies::$method(&push.parameters, $($arguments)* push.piece.first + id.x);
            }
        }
    };
    (
        {
            [$($doc:tt)*] $method:ident { $block:ident: $Block:ty }
            { tiles [$row_count:expr, $inner_count:expr, $column_count:expr] }
            { $($mark:ident)* }
        }
        [$($parameters:tt)*] [] [$($arguments:tt)*] [] $bindings:tt
    ) => {
        $($doc)*
        #[spirv(compute(threads(64)))]
        #[allow(clippy::too_many_arguments)]
        pub fn $method(
            #[spirv(global_invocation_id)] id: UVec3,
            #[spirv(push_constant)] push: &Push<$Block>,
            $($parameters)*
            #[spirv(workgroup)] rows: &mut SharedOfSingle,
            #[spirv(workgroup)] columns: &mut SharedOfSingle,
        ) {
            let $block = &push.parameters;
            let shape = Shape { row_count: $row_count, inner_count: $inner_count, column_count: $column_count };
            let tiles = Staged { rows, columns };
            bodies::$method($block, shape, $($arguments)* tiles, push.piece.first + id.x);
        }

        /// The other forms.
        pub mod $method {
            use super::*;

            /// By subgroups.
            #[spirv(compute(threads(64)))]
            #[allow(clippy::too_many_arguments)]
            pub fn subgroup(
                #[spirv(global_invocation_id)] id: UVec3,
                #[spirv(subgroup_id)] subgroup: u32,
                #[spirv(subgroup_local_invocation_id)] lane: u32,
                #[spirv(spec_constant(id = 1, default = 32))] size: u32,
                #[spirv(push_constant)] push: &Push<$Block>,
                $($parameters)*
            ) {
                let $block = &push.parameters;
                let shape = Shape { row_count: $row_count, inner_count: $inner_count, column_count: $column_count };
                let tiles = Subgroup { size, subgroup, lane };
                bodies::$method($block, shape, $($arguments)* tiles, push.piece.first + id.x);
            }
        }
    };
}

/// The entry points of a kernel for arrays in fours, whose arrays are a layer's. In brackets: the row's shape.
macro_rules! entries_in_fours {
    ($method:ident, $Block:ty, $block:ident [$row_count:expr, $inner_count:expr, $column_count:expr]) => {
        /// The forms of a kernel.
        pub mod $method {
            use super::super::*;

            entries_in_fours! {
                staged $method, $Block, $block [$row_count, $inner_count, $column_count],
                /// In tiles of 128 times 64.
                large Large (256) LargeRows LargeColumns,
                /// In tiles of 64 times 64.
                small Small (256) SmallRows SmallColumns,
                /// In tiles of 32 times 32.
                tiny Tiny (64) TinyRows TinyColumns,
                /// In tiles of 16 times 16.
                least Least (64) LeastRows LeastColumns
            }
            entries_in_fours! {
                halves $method, $Block, $block [$row_count, $inner_count, $column_count], UVec2 EndlessHalves,
                /// By matrix units, in f16.
                half half_stand_in Half (128) SharedOfHalf,
                /// The same in tiles of 64 times 64.
                half_small half_small_stand_in HalfSmall (128) SharedOfHalfSmall,
                /// The same in tiles of 32 times 32.
                half_tiny half_tiny_stand_in HalfTiny (128) SharedOfHalfTiny
            }
            entries_in_fours! {
                halves $method, $Block, $block [$row_count, $inner_count, $column_count], Vec4 EndlessFours,
                /// By matrix units, in f16 in two parts.
                two_halves two_halves_stand_in TwoHalves (256) SharedOfTwoHalves,
                /// The same in tiles of 64 times 64.
                two_halves_small two_halves_small_stand_in TwoHalvesSmall (128) SharedOfTwoHalvesSmall,
                /// The same in tiles of 32 times 32.
                two_halves_tiny two_halves_tiny_stand_in TwoHalvesTiny (128) SharedOfTwoHalvesTiny
            }
        }
    };
    (
        staged $method:ident, $Block:ty, $block:ident [$row_count:expr, $inner_count:expr, $column_count:expr],
        $($(#[$doc:meta])* $form:ident $Form:ident ($threads:literal) $Rows:ident $Columns:ident),+
    ) => {
        $(entries_in_fours! {
            one $method, $Block, $block [$row_count, $inner_count, $column_count], Vec4 EndlessFours,
            [$(#[$doc])*] $form ($threads) [] [
                #[spirv(workgroup)] rows: &mut shared::$Rows,
                #[spirv(workgroup)] columns: &mut shared::$Columns,
            ]
            id { InFours { tile: PhantomData::<$Form>, rows, columns } }
        })+
    };
    (
        halves $method:ident, $Block:ty, $block:ident [$row_count:expr, $inner_count:expr, $column_count:expr],
        $Weights:ident $Endless:ident,
        $($(#[$doc:meta])* $form:ident $stand_in:ident $Form:ident ($threads:literal) $Shared:ident),+
    ) => {
        $(entries_in_fours! {
            one $method, $Block, $block [$row_count, $inner_count, $column_count], $Weights $Endless,
            [$(#[$doc])* #[cfg(target_arch = "spirv")]] $form ($threads) [
                #[spirv(subgroup_id)] subgroup: u32,
                #[spirv(subgroup_local_invocation_id)] lane: u32,
            ] [
                #[spirv(workgroup)] shared: &mut $Shared,
            ]
            id { $Form { units: PhantomData::<Matrices>, shared, subgroup, lane } }
        }
        entries_in_fours! {
            one $method, $Block, $block [$row_count, $inner_count, $column_count], $Weights $Endless,
            [$(#[$doc])* #[doc = "\n\nBy plain arithmetic in the place of matrix units."]] $stand_in ($threads) [] [
                #[spirv(workgroup)] shared: &mut $Shared,
            ]
            id {
                $Form { units: PhantomData::<StandIns>, shared, subgroup: id.x % $threads / 32, lane: id.x % 32 }
            }
        })+
    };
    // What measures the units has their form alone.
    (repeated $method:ident, $Block:ty, $block:ident [$row_count:expr, $inner_count:expr, $column_count:expr]) => {
        /// The form of a kernel that measures matrix units.
        pub mod $method {
            use super::super::*;

            entries_in_fours! {
                of_two $method, $Block, $block [$row_count, $inner_count, $column_count],
                [
                    /// By matrix units, in f16.
                    #[cfg(target_arch = "spirv")]
                ]
                half [
                    #[spirv(subgroup_id)] subgroup: u32,
                    #[spirv(subgroup_local_invocation_id)] lane: u32,
                ] shared
                id { Repeated { units: PhantomData::<Matrices>, shared, subgroup, lane } }
            }
            entries_in_fours! {
                of_two $method, $Block, $block [$row_count, $inner_count, $column_count],
                [
                    /// By plain arithmetic in the place of matrix units.
                ]
                half_stand_in [] shared
                id { Repeated { units: PhantomData::<StandIns>, shared, subgroup: id.x % 128 / 32, lane: id.x % 32 } }
            }
        }
    };
    (
        of_two $method:ident, $Block:ty, $block:ident [$row_count:expr, $inner_count:expr, $column_count:expr],
        [$(#[$mark:meta])*] $form:ident [$($before:tt)*] $shared:ident $id:ident { $($tiles:tt)* }
    ) => {
        $(#[$mark])*
        #[spirv(compute(threads(128)))]
        #[allow(clippy::too_many_arguments)]
        pub fn $form(
            #[spirv(global_invocation_id)] $id: UVec3,
            $($before)*
            #[spirv(push_constant)] push: &Push<$Block>,
            #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] left: &[Vec4],
            #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] right: &[Vec4],
            #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] sums: &mut [Vec4],
            #[spirv(workgroup)] $shared: &mut SharedOfRepeated,
        ) {
            let $block = &push.parameters;
            let shape = Shape { row_count: $row_count, inner_count: $inner_count, column_count: $column_count };
            let (left, right, sums) = (EndlessFours(left), EndlessFours(right), UncheckedFours(sums));
            let (tiles, invocation) = ($($tiles)*, push.piece.first + $id.x);
            bodies::$method($block, shape, left, right, sums, tiles, invocation);
        }
    };
    // How the weights lie, and how the body gets them.
    (
        one $method:ident, $Block:ty, $block:ident [$row_count:expr, $inner_count:expr, $column_count:expr],
        $Weights:ident $Endless:ident,
        [$(#[$mark:meta])*] $form:ident ($threads:literal) [$($before:tt)*] [$($memory:tt)*] $id:ident { $($tiles:tt)* }
    ) => {
        $(#[$mark])*
        #[spirv(compute(threads($threads)))]
        #[allow(clippy::too_many_arguments)]
        pub fn $form(
            #[spirv(global_invocation_id)] $id: UVec3,
            $($before)*
            #[spirv(push_constant)] push: &Push<$Block>,
            #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[Vec4],
            #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[$Weights],
            #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[Vec4],
            #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[Vec4],
            #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] outputs: &mut [Vec4],
            $($memory)*
        ) {
            let $block = &push.parameters;
            let shape = Shape { row_count: $row_count, inner_count: $inner_count, column_count: $column_count };
            let (inputs, weights) = (EndlessFours(inputs), $Endless(weights));
            let (bias, residual, outputs) = (EndlessFours(bias), EndlessFours(residual), UncheckedFours(outputs));
            let (tiles, invocation) = ($($tiles)*, push.piece.first + $id.x);
            bodies::$method($block, shape, inputs, weights, bias, residual, outputs, tiles, invocation);
        }
    };
}

/// Words of the workgroup's memory that a kernel takes whose elements are computed together.
macro_rules! shared_words {
    (blend_gradient) => {
        bodies::together::BLEND_GRADIENT_SHARED
    };
    (group_norm_partials) => {
        bodies::together::GROUP_NORM_PARTIALS_SHARED
    };
    (softmax_rows) => {
        bodies::together::SOFTMAX_ROWS_SHARED
    };
    (group_norm) => {
        bodies::together::GROUP_NORM_SHARED
    };
    (blend_splats) => {
        bodies::together::BLEND_SPLATS_SHARED
    };
    (count_entries) => {
        bodies::together::ENTRIES_SHARED
    };
    (list_entries) => {
        bodies::together::ENTRIES_SHARED
    };
    (sum_entries) => {
        bodies::together::SUM_ENTRIES_SHARED
    };
    (follow_paths) => {
        bodies::together::FOLLOW_PATHS_SHARED
    };
    (sum_shares) => {
        bodies::together::SUM_SHARES_SHARED
    };
    (start_tiles) => {
        bodies::together::START_TILES_SHARED
    };
}

/// How a body that must not panic gets a binding.
macro_rules! unchecked {
    (write $array:ident, vectors) => {
        &mut VectorsMut(&mut Unchecked($array))
    };
    (write $array:ident) => {
        &mut Unchecked($array)
    };
    ($kind:ident $array:ident, vectors) => {
        &Vectors(&Endless($array))
    };
    (write $array:ident) => {
        &mut Unchecked($array)
    };
    ($kind:ident $array:ident) => {
        &Endless($array)
    };
}

/// The type of a binding.
macro_rules! bound {
    (one $Host:ty) => {
        &$Host
    };
    (write $Host:ty) => {
        &mut [$Host]
    };
    (write $Host:ty, vectors) => {
        &mut [<$Host as InVectors>::Vectors]
    };
    ($kind:ident $Host:ty) => {
        &[$Host]
    };
    ($kind:ident $Host:ty, vectors) => {
        &[<$Host as InVectors>::Vectors]
    };
}

/// How the body gets it.
macro_rules! lent {
    (paged $array:ident) => {
        &$array
    };
    (paged $array:ident, vectors) => {
        &Vectors(&$array)
    };
    (write_paged $array:ident) => {
        &mut $array
    };
    (write_paged $array:ident, vectors) => {
        &mut VectorsMut(&mut $array)
    };
    (write $array:ident, vectors) => {
        &mut VectorsMut($array)
    };
    ($kind:ident $array:ident, vectors) => {
        &Vectors($array)
    };
    ($kind:ident $array:ident) => {
        $array
    };
}
