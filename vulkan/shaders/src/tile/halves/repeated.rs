//! A product that is added again and again without loading anything, to measure how fast the units are.

use super::*;
use viewfuse_kernels::limits::REPEATED;

/// Those of [`Half`](super::Half), with the inner indices that are repeated.
const SIZES: Sizes = Sizes { form: Form::Half, parts: 1, step: REPEATED, subgroups: [2, 2, 1] };
const ROWS: u32 = SIZES.form.rows();
const COLUMNS: u32 = SIZES.form.columns();
const INVOCATIONS: u32 = SIZES.form.invocations();
const OWN_ROWS: u32 = SIZES.of_subgroup()[0];
const OWN_COLUMNS: u32 = SIZES.of_subgroup()[1];
/// Subgroups beside one another.
const ACROSS: u32 = SIZES.subgroups[1];
/// Eights of a row of the left matrix, and those of a row of the right one.
const EIGHTS: u32 = REPEATED / 8;
const COLUMN_EIGHTS: u32 = COLUMNS / 8;
/// From a row to the next, of the matrices and of sums.
const LEFT_STRIDE: u32 = SIZES.left_stride();
const RIGHT_STRIDE: u32 = SIZES.right_stride();
const STRIDE: u32 = SIZES.sums_stride();
/// Where the right matrix begins.
const LEFT: u32 = SIZES.left();
/// 16 rows of a subgroup's sums.
const PATCH: u32 = 16 * STRIDE;

/// Both matrices, and in their place at the end 16 rows of sums of each subgroup.
pub(crate) type SharedOfRepeated = [UVec4; {
    let (matrices, sums) = (LEFT + SIZES.right(), INVOCATIONS / SUBGROUP * PATCH);
    let most = if matrices > sums { matrices } else { sums } as usize;
    assert!(most * size_of::<UVec4>() <= SIZES.form.shared_bytes());
    most
}];

/// A product of which all rounds have the same factors.
pub(crate) struct Repeated<'a, U> {
    pub(crate) units: PhantomData<U>,
    pub(crate) shared: &'a mut SharedOfRepeated,
    /// As of [`Half`](super::Half).
    pub(crate) subgroup: u32,
    pub(crate) lane: u32,
}

impl<U: Units> Tiles for Repeated<'_, U> {
    /// `left` and `right` begin again behind the first inner indices.
    #[inline(always)]
    fn multiply<L: Left>(self, invocation: u32, shape: Shape, left: L, right: impl Right, mut outputs: impl Outputs) {
        let Repeated { units: _, shared, subgroup, lane } = self;
        let (group, local) = (invocation / INVOCATIONS, invocation % INVOCATIONS);
        let group_columns = shape.column_count.div_ceil(COLUMNS);
        let (first_row, first_column) = (group / group_columns * ROWS, group % group_columns * COLUMNS);
        let (own_row, own_column) = (subgroup / ACROSS * OWN_ROWS, subgroup % ACROSS * OWN_COLUMNS);
        let mut index = local;
        while index < ROWS * EIGHTS {
            let (row, eight) = (index / EIGHTS, index % EIGHTS);
            let numbers = fetch_row(left, left.row((first_row + row).min(shape.row_count - 1)), left.inner(eight * 8));
            let numbers = finished_row(left, false, eight * 8, numbers, shape);
            write(shared, row * LEFT_STRIDE + eight, packed::<U>(numbers));
            index += INVOCATIONS;
        }
        index = local;
        while index < REPEATED * COLUMN_EIGHTS {
            let (inner, eight) = (index / COLUMN_EIGHTS, index % COLUMN_EIGHTS);
            let numbers = Eight::fetch(right, inner, first_column + eight * 8, shape);
            write(shared, LEFT + inner * RIGHT_STRIDE + eight, packed::<U>(numbers));
            index += INVOCATIONS;
        }
        wait_for_all();

        let rows = {
            let rows = |matrix: u32| U::rows(shared, (own_row + matrix * 16) * LEFT_STRIDE, LEFT_STRIDE);
            [rows(0), rows(1), rows(2), rows(3)]
        };
        let columns = {
            let first = LEFT + own_column / 8;
            let columns = |matrix: u32| U::columns(shared, first + matrix * 2, RIGHT_STRIDE);
            [columns(0), columns(1), columns(2), columns(3)]
        };
        let mut sums = [[U::zero(); 4]; 4];
        let mut inner = 0;
        while inner < shape.inner_count {
            unroll!(J in [0 1 2 3] {
                sums[0][J] = U::add(sums[0][J], rows[0], columns[J], shared, lane);
                sums[1][J] = U::add(sums[1][J], rows[1], columns[J], shared, lane);
                sums[2][J] = U::add(sums[2][J], rows[2], columns[J], shared, lane);
                sums[3][J] = U::add(sums[3][J], rows[3], columns[J], shared, lane);
            });
            inner += REPEATED;
        }
        wait_for_all();

        let patch = subgroup * PATCH;
        unroll!(I in [0 1 2 3] {
            unroll!(J in [0 1 2 3] {
                U::store(sums[I][J], shared, patch + J as u32 * 4, STRIDE, lane);
            });
            wait_for_all();
            const FOURS: u32 = OWN_COLUMNS / 4;
            let mut index = lane;
            while index < 16 * FOURS {
                let sum = numbers(read(shared, patch + index / FOURS * STRIDE + index % FOURS));
                let row = first_row + own_row + I as u32 * 16 + index / FOURS;
                let column = first_column + own_column + index % FOURS * 4;
                if row < shape.row_count && column < shape.column_count {
                    outputs.put_four(row, column, Vec4::new(finite(sum.x), finite(sum.y), finite(sum.z), finite(sum.w)));
                }
                index += SUBGROUP;
            }
            wait_for_all();
        });
    }
}
