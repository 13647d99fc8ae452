//! Costs along lines: an invocation of a workgroup has a group of planes of a line.

use crate::plane_sweep::path::{CostBlock, LINES_TOGETHER, advanced};
use crate::plane_sweep::{MAX_GROUPS, PLANES, Planes, least_of};
use crate::rows::WORKGROUP;
use crate::store::Store;
use crate::workgroup::Workgroup;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::math::min;

/// Groups of a line.
const GROUPS: u32 = MAX_GROUPS as u32;
/// Where the costs of each group's first plane begin, behind those of its last plane.
const FIRSTS: usize = WORKGROUP as usize;
/// Where the least cost of each group begins.
const LEAST: usize = 2 * WORKGROUP as usize;

/// Words of the workgroup's memory that [`follow_paths`] takes.
pub const FOLLOW_PATHS_SHARED: usize = 3 * WORKGROUP as usize;

const _: () = assert!(WORKGROUP == LINES_TOGETHER * GROUPS);

/// A group of planes of one of eight lines, invocation `invocation % 64` of the element `invocation / 64`.
#[inline(always)]
pub fn follow_paths(
    block: &CostBlock,
    means: &impl Fetch<Planes>,
    paths: &mut impl Store<Planes>,
    mut group: impl Workgroup,
    invocation: u32,
) {
    let (element, thread) = (invocation / WORKGROUP, invocation % WORKGROUP);
    let (line, planes) = (element * LINES_TOGETHER + thread / GROUPS, thread % GROUPS);
    let is_there = planes < block.group_count && line < block.line_count();
    let (mut direction, mut number, mut step_count, mut first) = (0, 0, 0, 0);
    if is_there {
        (direction, number, step_count) = block.line(line);
        first = block.first_of_line(line) + planes as usize;
    }
    let at = |step: u32| (block.pixel(direction, number, step) * block.group_count + planes) as usize;
    let mut before = [0.0; PLANES];
    let mut cost = if step_count > 0 { means.fetch(at(0)) } else { [0.0; PLANES] };
    let longest = if block.width > block.height { block.width } else { block.height };
    let mut step = 0;
    // Lines of one workgroup may have different lengths; all invocations come to the barriers.
    while step < longest {
        group.put(thread as usize, before[PLANES - 1]);
        group.put(FIRSTS + thread as usize, before[0]);
        group.put(LEAST + thread as usize, if is_there { least_of(&before) } else { f32::MAX });
        // The next costs are on their way while these are joined.
        let next = if step + 1 < step_count { means.fetch(at(step + 1)) } else { cost };
        group.wait();
        if step < step_count {
            let left = if planes > 0 { group.get(thread as usize - 1) } else { f32::MAX };
            let right = if planes + 1 < block.group_count { group.get(FIRSTS + thread as usize + 1) } else { f32::MAX };
            let (mut least, mut other) = (f32::MAX, thread - planes);
            while other < thread - planes + GROUPS {
                least = min(group.get(LEAST + other as usize), least);
                other += 1;
            }
            before = advanced(&before, &cost, [left, right], least);
            paths.store(first + (step * block.group_count) as usize, before);
        }
        cost = next;
        group.wait();
        step += 1;
    }
}
