//! Sums of pixels' shares, in their order: the shares come through the workgroup's memory, and an invocation sums a
//! channel.

use crate::gaussians::windows::SHARE_RUN;
use crate::rows::{SHARED_BYTES, WORKGROUP};
use crate::store::Store;
use crate::workgroup::Workgroup;
use viewfuse_core::fetch::Fetch;

/// Red, green, blue.
const CHANNELS: u32 = 3;
/// From a channel to the next: odd, so that invocations that sum them read different banks.
const STRIDE: usize = SHARE_RUN as usize + 1;
/// Where the sums begin.
const SUMS: usize = CHANNELS as usize * STRIDE;

/// Words of the workgroup's memory that [`sum_shares`] takes.
pub const SUM_SHARES_SHARED: usize = SUMS + CHANNELS as usize;

const _: () = assert!(4 * SUM_SHARES_SHARED <= SHARED_BYTES && CHANNELS < WORKGROUP);

/// Some pixels of a run, invocation `invocation % 64` of the run `invocation / 64`.
#[inline(always)]
pub fn sum_shares(
    pixel_count: &u32,
    shares: &impl Fetch<[f32; 4]>,
    sums: &mut impl Store<[f32; 4]>,
    mut group: impl Workgroup,
    invocation: u32,
) {
    let (run, thread) = (invocation / WORKGROUP, invocation % WORKGROUP);
    let first = run * SHARE_RUN;
    let count = if *pixel_count - first < SHARE_RUN { *pixel_count - first } else { SHARE_RUN };
    let mut pixel = thread;
    while pixel < count {
        let [red, green, blue, _] = shares.fetch((first + pixel) as usize);
        group.put(pixel as usize, red);
        group.put(STRIDE + pixel as usize, green);
        group.put(2 * STRIDE + pixel as usize, blue);
        pixel += WORKGROUP;
    }
    group.wait();
    if thread < CHANNELS {
        let mut sum = 0.0;
        pixel = 0;
        while pixel < count {
            sum += group.get(thread as usize * STRIDE + pixel as usize);
            pixel += 1;
        }
        group.put(SUMS + thread as usize, sum);
    }
    group.wait();
    if thread == 0 {
        sums.store(run as usize, [group.get(SUMS), group.get(SUMS + 1), group.get(SUMS + 2), 0.0]);
    }
}
