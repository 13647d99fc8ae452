//! Lists of samples and numbers that are not finite.

use super::dispatch;
use viewfuse_kernels::compact::RUN;
use viewfuse_kernels::finite::{ALL_FINITE, FINITE_RUN};

/// From a mask to its list, by the three kernels one after the other, beside the list as an iterator makes it.
#[test]
fn a_mask_becomes_its_list() {
    let mask: Vec<u32> = (0..3 * RUN + 17).map(|element| u32::from(element % 7 == 3 || element / 100 == 4)).collect();
    let (count, run_count) = (mask.len() as u32, 4);
    let mut counts = vec![99; 5];
    dispatch(count, run_count, |id, push| viewfuse_shaders::count_marked(id, push, &mask, &mut counts));
    assert_eq!(counts[4], 99);
    let (mut offsets, mut total) = (vec![99; 6], vec![99; 2]);
    dispatch(run_count, 1, |id, push| viewfuse_shaders::sum_counts(id, push, &counts, &mut offsets, &mut total));
    let expected: Vec<u32> = (0..count).filter(|element| mask[*element as usize] != 0).collect();
    assert_eq!((total, offsets[4], offsets[5]), (vec![expected.len() as u32, 99], expected.len() as u32, 99));
    let mut list = vec![99_999; mask.len()];
    dispatch(count, run_count, |id, push| viewfuse_shaders::list_marked(id, push, &mask, &offsets, &mut list));
    assert_eq!(list[..expected.len()], expected);
    assert!(list[expected.len()..].iter().all(|element| *element == 99_999));
}

#[test]
fn the_first_number_of_a_run_that_is_not_finite() {
    let mut values = vec![1.0; 3 * FINITE_RUN as usize];
    values[5] = f32::NEG_INFINITY;
    values[7] = f32::NAN;
    values[2 * FINITE_RUN as usize + 1] = -f32::NAN;
    let mut firsts = vec![99; 4];
    // The last number does not count.
    let count = values.len() as u32 - 1;
    dispatch(count, 3, |id, push| viewfuse_shaders::find_non_finite(id, push, &values, &mut firsts));
    assert_eq!(firsts, [5, ALL_FINITE, 2 * FINITE_RUN + 1, 99]);
}
