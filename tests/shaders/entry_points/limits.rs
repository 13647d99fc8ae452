//! What a device can do at most.

use super::vectors::{arrays, fours};
use super::{UNTOUCHED, dispatch, numbers};
use viewfuse_kernels::limits::{ChainBlock, chained};

#[test]
fn limits_are_core_s() {
    let given: Vec<[f32; 4]> = numbers(40, 4 * 70).as_chunks::<4>().0.to_vec();
    let (read, mut copies) = (fours(&given), fours(&[[UNTOUCHED; 4]; 71]));
    dispatch((), 70, |id, push| viewfuse_shaders::copy_numbers(id, &push.piece, &read, &mut copies));
    assert_eq!(arrays(&copies[..70]), given);
    assert_eq!(arrays(&copies[70..]), [[UNTOUCHED; 4]]);

    let starts = numbers(41, 70);
    for round_count in [0, 1, 3] {
        let block = ChainBlock { factor: 0.9, summand: 0.2, round_count };
        let mut ends = vec![UNTOUCHED; 71];
        dispatch(block, 70, |id, push| viewfuse_shaders::multiply_add(id, push, &starts, &mut ends));
        let expected: Vec<f32> = starts.iter().map(|start| chained(&block, *start)).collect();
        assert_eq!(ends[..70], expected);
        assert_eq!(ends[70], UNTOUCHED);
    }
}
