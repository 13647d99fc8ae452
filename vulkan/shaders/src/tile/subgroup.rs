//! One tile, whose rows pass between the invocations of a subgroup
//! ([`Form::Subgroup`](viewfuse_kernels::rows::Form::Subgroup)).
//!
//! Eight neighbours of a subgroup need the same eight rows and different columns. Each of them loads one of these rows,
//! eight inner indices at once, and gets the other rows from the others. The columns come straight from the buffer:
//! neighbours load what lies next to one another. No memory of the workgroup and no barrier is used.
//!
//! A subgroup has 8, 16, 32 or 64 invocations, all of which take part: the pipeline demands full subgroups of the size
//! that its specialisation constant says.

use super::{InvocationTile, row_place, store_sums};
use spirv_std::arch::{subgroup_broadcast_const, subgroup_shuffle};
use spirv_std::glam::Vec4;
use viewfuse_kernels::network::tile::{EightSums, Left, Outputs, Right, Shape, Sums, TILE, Tiles};

/// Invocations that need the same rows, and inner indices that each of them loads at once.
const CLUSTER: u32 = EightSums::ROWS;

/// Where an invocation is in its workgroup: what this form has in the place of memory.
#[derive(Clone, Copy)]
pub(crate) struct Subgroup {
    /// Invocations of a subgroup.
    pub(crate) size: u32,
    /// The subgroup's number in the workgroup.
    pub(crate) subgroup: u32,
    /// The invocation's number in the subgroup.
    pub(crate) lane: u32,
}

impl Tiles for Subgroup {
    #[inline(always)]
    fn multiply<L: Left>(self, invocation: u32, shape: Shape, left: L, right: impl Right, mut outputs: impl Outputs) {
        // Which invocations are in a subgroup is the driver's choice: the number in the workgroup follows from that.
        let invocation_of_tile = (self.subgroup * self.size + self.lane) % TILE;
        let place = InvocationTile::new(invocation / TILE, invocation_of_tile, [TILE; 2], CLUSTER, shape);
        let row = (place.first_row + row_place(CLUSTER, place.own_row, place.own_column)).min(shape.row_count - 1);
        let column =
            move |four: u32, index: u32| place.first_column + row_place(CLUSTER, place.own_column, 4 * four + index);
        let row = left.row(row);
        let left = move |inner: u32| left.number(row, left.inner(inner.min(shape.inner_count - 1)));
        let right = move |inner: u32, column: u32| right.number(inner, column.min(shape.column_count - 1));
        let fetch_four = move |inner: u32, column: u32| {
            Vec4::new(
                right(inner, column),
                right(inner, column + 1),
                right(inner, column + 2),
                right(inner, column + 3),
            )
        };
        let mut sums = EightSums::ZERO;
        let mut start = 0;
        while start < shape.inner_count {
            let mut near = Vec4::new(left(start), left(start + 1), left(start + 2), left(start + 3));
            let mut far = Vec4::new(left(start + 4), left(start + 5), left(start + 6), left(start + 7));
            let end = shape.inner_count.min(start + CLUSTER);
            let mut inner = start;
            while inner < end {
                let rows = self.rows_of_all(near.x);
                sums.add(rows, [fetch_four(inner, column(0, 0)), fetch_four(inner, column(1, 0))]);
                near = Vec4::new(near.y, near.z, near.w, far.x);
                far = Vec4::new(far.y, far.z, far.w, 0.0);
                inner += 1;
            }
            start += CLUSTER;
        }
        store_sums(sums, place, CLUSTER, shape, column, &mut outputs);
    }
}

impl Subgroup {
    /// The numbers of the eight invocations that need the same rows, in the order of the rows.
    #[inline(always)]
    fn rows_of_all(self, value: f32) -> [Vec4; 2] {
        if self.size == CLUSTER {
            return [
                Vec4::new(first::<0>(value), first::<1>(value), first::<2>(value), first::<3>(value)),
                Vec4::new(first::<4>(value), first::<5>(value), first::<6>(value), first::<7>(value)),
            ];
        }
        let first = self.lane / CLUSTER * CLUSTER;
        let of = move |row: u32| subgroup_shuffle(value, first + row);
        [Vec4::new(of(0), of(1), of(2), of(3)), Vec4::new(of(4), of(5), of(6), of(7))]
    }
}

/// The number of an invocation among the subgroup's first eight.
#[inline(always)]
#[allow(unsafe_code)]
fn first<const LANE: u32>(value: f32) -> f32 {
    // SAFETY: a full subgroup has at least eight invocations, and all of them are here.
    unsafe { subgroup_broadcast_const::<f32, LANE>(value) }
}
