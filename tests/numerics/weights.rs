//! [`Weights`]: whatever goes in, a point of the simplex comes out; leaving views out changes sums by what it says.

use proptest::prelude::*;
use viewfuse_core::fuse::fuse_views;
use viewfuse_core::weights::Weights;

const S: usize = 8;

/// On the simplex to within `S * 2^-24`, with nothing beyond the count.
fn on_simplex<const N: usize>(weights: &Weights<N>) -> bool {
    let sum: f64 = weights.values().iter().map(|w| f64::from(*w)).sum();
    let beyond = &weights.values()[weights.count() as usize..];
    weights.values().iter().all(|w| w.is_finite() && *w >= 0.0)
        && (sum - 1.0).abs() <= f64::from(weights.count()) / 16_777_216.0
        && beyond.iter().all(|w| *w == 0.0)
}

/// Any `f32`: NaN, infinities, subnormals and zeros often.
fn any_number() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => any::<u32>().prop_map(f32::from_bits),
        4 => -10.0_f32..10.0,
        1 => Just(f32::NAN),
        1 => Just(f32::INFINITY),
        1 => Just(f32::NEG_INFINITY),
        1 => Just(0.0),
        1 => Just(f32::MAX),
    ]
}

fn numbers() -> impl Strategy<Value = [f32; S]> {
    proptest::collection::vec(any_number(), S).prop_map(|v| std::array::from_fn(|i| v[i]))
}

fn scores() -> impl Strategy<Value = [f32; S]> {
    proptest::collection::vec(prop_oneof![0.0_f32..1.0, 0.0_f32..1.0e-4, Just(0.0)], S)
        .prop_map(|v| std::array::from_fn(|i| v[i]))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_input_gives_weights(input in numbers(), count in 0_u32..12) {
        for weights in [
            Weights::from_scores(&input, count),
            Weights::from_errors(&input, count),
            Weights::from_logits(&input, count),
            Weights::mean(count),
        ] {
            prop_assert!(on_simplex(&weights), "{:?} of {:?}", weights, input);
            prop_assert_eq!(weights.count(), count.clamp(1, S as u32));
        }
    }

    #[test]
    fn larger_scores_never_weigh_less(input in numbers()) {
        let by_score = Weights::from_scores(&input, S as u32);
        let by_error = Weights::from_errors(&input, S as u32);
        let by_logit = Weights::from_logits(&input, S as u32);
        for i in 0..S {
            for j in 0..S {
                if input[i] > input[j] && input[j] >= 0.0 {
                    prop_assert!(by_score.values()[i] >= by_score.values()[j]);
                    prop_assert!(by_error.values()[i] <= by_error.values()[j]);
                }
                if input[i] > input[j] {
                    // `exp` is monotone to its error only.
                    prop_assert!(by_logit.values()[i] >= by_logit.values()[j] * (1.0 - 4.0e-7));
                }
            }
        }
    }

    #[test]
    fn omission_keeps_its_bound(input in scores(), total in 0.0_f32..0.99,
        latents in proptest::collection::vec(-3.0_f32..5.0, S)) {
        let weights = Weights::from_scores(&input, S as u32);
        let omission = weights.without_least(total);
        prop_assert!(on_simplex(&omission.weights));
        prop_assert!(omission.omitted_weight <= total);
        let largest = weights.values().iter().copied().fold(0.0, f32::max);
        let kept = |view: usize| omission.weights.values()[view] > 0.0;
        prop_assert!((0..S).any(|view| kept(view) && weights.values()[view] == largest), "the largest stays");
        for omitted in (0..S).filter(|view| !kept(*view)) {
            for remaining in (0..S).filter(|view| kept(*view)) {
                prop_assert!(weights.values()[omitted] <= weights.values()[remaining]);
            }
        }
        let gone = (0..S).filter(|view| weights.values()[*view] > 0.0 && !kept(*view)).count();
        prop_assert_eq!(gone, omission.omitted_count as usize);
        let latents: [[f32; 1]; S] = std::array::from_fn(|view| [latents[view]]);
        let change = (fuse_views(&weights, &latents)[0] - fuse_views(&omission.weights, &latents)[0]).abs();
        let rounding = 5.0 * 4.0 * S as f32 / 16_777_216.0;
        prop_assert!(change <= omission.bound(8.0) + rounding, "{} > {}", change, omission.bound(8.0));
    }

    #[test]
    fn omission_is_monotone_in_its_total(input in scores(), a in 0.0_f32..0.99, b in 0.0_f32..0.99) {
        let weights = Weights::from_scores(&input, S as u32);
        let (less, more) = (weights.without_least(a.min(b)), weights.without_least(a.max(b)));
        prop_assert!(less.omitted_count <= more.omitted_count && less.omitted_weight <= more.omitted_weight);
        for view in 0..S {
            prop_assert!(less.weights.values()[view] > 0.0 || more.weights.values()[view] == 0.0);
        }
    }
}

#[test]
fn the_omission_bound_is_reached_and_can_fail() {
    let weights = Weights::from_scores(&[0.9_f32, 0.1], 2);
    let omission = weights.without_least(0.2);
    let change = fuse_views(&omission.weights, &[[0.0], [1.0]])[0] - fuse_views(&weights, &[[0.0], [1.0]])[0];
    assert_eq!(omission.omitted_count, 1);
    assert!((change.abs() - omission.bound(1.0)).abs() < 1.0e-7);
    assert!(change.abs() > 0.5 * omission.bound(1.0), "half of the bound would not hold");
}

#[test]
fn nothing_is_omitted_for_free() {
    let weights = Weights::from_scores(&[0.0_f32, 0.5, 0.5], 3);
    for total in [0.0, -1.0, f32::NAN] {
        let omission = weights.without_least(total);
        assert_eq!((omission.weights, omission.omitted_count, omission.omitted_weight), (weights, 0, 0.0));
    }
    let omission = weights.without_least(1.0e9);
    assert_eq!(omission.weights.values(), &[0.0, 0.5, 0.5], "the greatest stay, all of them");
}

#[test]
fn degenerate_scores() {
    let third = [1.0 / 3.0; 3];
    for scores in [[0.0; 3], [f32::NAN; 3], [-1.0; 3], [f32::INFINITY; 3], [f32::MAX; 3], [f32::MIN_POSITIVE; 3]] {
        assert_eq!(Weights::from_scores(&scores, 3).values(), &third, "{scores:?}");
    }
    assert_eq!(Weights::from_scores(&[f32::NAN, 2.0, -3.0], 3).values(), &[0.0, 1.0, 0.0]);
    for errors in [[0.0; 3], [f32::NAN; 3], [-1.0; 3], [f32::INFINITY; 3], [f32::MAX; 3], [1.0e-30; 3]] {
        assert_eq!(Weights::from_errors(&errors, 3).values(), &third, "{errors:?}");
    }
    // What counts as infinite counts as what is.
    for error in [f32::NAN, -1.0] {
        assert_eq!(Weights::from_errors(&[error, f32::INFINITY], 2).values(), &[0.5; 2], "{error}");
    }
    assert_eq!(Weights::from_logits(&[f32::NAN, f32::NEG_INFINITY], 2).values(), &[0.5; 2]);
    assert_eq!(Weights::from_errors(&[0.0, 1.0, 0.0], 3).values(), &[0.5, 0.0, 0.5]);
    assert_eq!(Weights::from_errors(&[f32::NAN, 1.0, f32::INFINITY], 3).values(), &[0.0, 1.0, 0.0]);
    for logits in [[0.0; 3], [f32::NAN; 3], [f32::NEG_INFINITY; 3], [f32::INFINITY; 3], [1.0e30; 3], [-1.0e30; 3]] {
        assert_eq!(Weights::from_logits(&logits, 3).values(), &third, "{logits:?}");
    }
    assert_eq!(Weights::from_logits(&[f32::INFINITY, 1.0, f32::INFINITY], 3).values(), &[0.5, 0.0, 0.5]);
    assert_eq!(Weights::from_logits(&[f32::NAN, 1.0, f32::NEG_INFINITY], 3).values(), &[0.0, 1.0, 0.0]);
    for number in [0.0, f32::NAN, f32::INFINITY, -5.0, 1.0e30] {
        assert_eq!(Weights::from_scores(&[number], 1).values(), &[1.0]);
        assert_eq!(Weights::from_errors(&[number], 1).values(), &[1.0]);
        assert_eq!(Weights::from_logits(&[number], 1).values(), &[1.0]);
    }
}

#[test]
fn equal_weights_go_or_stay_together() {
    for count in 1..=32 {
        assert_eq!(Weights::<32>::mean(count).without_least(0.9).omitted_count, 0, "{count} equal views");
    }
    let mut scores = [0.0; S];
    scores[..6].copy_from_slice(&[8.0, 1.0, 4.0, 1.0, 0.0, 2.0]);
    let weights = Weights::from_scores(&scores, 6);
    let none = weights.without_least(1.9 / 16.0);
    assert_eq!((none.omitted_count, none.weights), (0, weights));
    let two = weights.without_least(2.0 / 16.0);
    assert_eq!((two.omitted_count, two.weights.get(1), two.weights.get(3)), (2, 0.0, 0.0));
    assert!(two.weights.get(5) > 0.0 && (two.omitted_weight - 0.125).abs() < 1.0e-6);
}
