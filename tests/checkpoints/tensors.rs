//! Comparing the tensors of a file with those of an architecture, and values that are NaN or infinite.

use super::{assert_claims_refused, assert_refused, pair};
use std::collections::BTreeMap;
use viewfuse::nn::checkpoint::{Checkpoint, CheckpointError, TensorShape};
use viewfuse_tests::checkpoints::safetensors;

fn shapes(names: &[(&str, &[usize])]) -> Vec<TensorShape> {
    names.iter().map(|(name, shape)| TensorShape { name: (*name).to_owned(), shape: shape.to_vec() }).collect()
}

fn holding(names: &[(&str, &[usize])]) -> Checkpoint {
    let tensors = shapes(names).into_iter().map(|tensor| {
        let count = tensor.shape.iter().product();
        (tensor, vec![0.5; count])
    });
    Checkpoint::in_memory("it", tensors, BTreeMap::new())
}

/// The message of a check that must fail.
#[track_caller]
fn fault(held: &[(&str, &[usize])], expected: &[(&str, &[usize])]) -> String {
    let outcome = holding(held).check(&shapes(expected), |name| name.ends_with("num_batches_tracked"));
    let error = outcome.expect_err("must be refused");
    assert!(matches!(error, CheckpointError::Tensors { .. }), "{error:?}");
    error.to_string()
}

#[test]
fn the_right_tensors() {
    let held: &[(&str, &[usize])] = &[("a", &[2, 3]), ("b", &[]), ("bn.num_batches_tracked", &[])];
    let optional = |name: &str| name == "bn.num_batches_tracked";
    holding(held).check(&shapes(&held[..2]), optional).expect("optional ones may be there");
    holding(&held[..2]).check(&shapes(&held[..2]), optional).expect("and may not");
}

#[test]
fn missing_unexpected_and_misshapen() {
    assert_eq!(
        fault(&[("a", &[3, 2]), ("c", &[1]), ("d", &[1])], &[("a", &[2, 3]), ("b", &[])]),
        "it: not the tensors of this architecture; missing: b; unexpected: c, d; of another shape: a is [3, 2], not \
            [2, 3]"
    );
    // The same number of elements, another number of axes.
    let message = fault(&[("a", &[6])], &[("a", &[6, 1])]);
    assert_eq!(message, "it: not the tensors of this architecture; of another shape: a is [6], not [6, 1]");
}

#[test]
fn long_lists_are_cut() {
    let names: Vec<String> = (10..30).map(|number| format!("t{number}")).collect();
    let expected: Vec<(&str, &[usize])> = names.iter().map(|name| (name.as_str(), [1].as_slice())).collect();
    let message = fault(&[], &expected);
    assert!(message.ends_with("missing: t10, t11, t12, t13, t14, t15, t16, t17 and 12 more"), "{message}");
}

#[test]
fn renamed_tensors_are_explained() {
    let plain: [(&str, &[usize]); 3] = [("a.weight", &[1]), ("a.bias", &[1]), ("b", &[1])];
    let longer: [(&str, &[usize]); 3] = [("net.a.weight", &[1]), ("net.a.bias", &[1]), ("net.b", &[1])];
    let hint = "(the names in the file begin with 'net.', those of the architecture do not)";
    assert!(fault(&longer, &plain).ends_with(hint), "{}", fault(&longer, &plain));
    let hint = "(the names in the file lack the 'net.' that those of the architecture begin with)";
    assert!(fault(&plain, &longer).ends_with(hint), "{}", fault(&plain, &longer));
    // One of three that happens to end so is no explanation.
    let other: [(&str, &[usize]); 3] = [("net.a.weight", &[1]), ("x", &[1]), ("y", &[1])];
    assert!(!fault(&other, &plain).contains("begin"), "{}", fault(&other, &plain));
}

#[test]
fn no_such_tensor() {
    let error = holding(&[("a", &[1])]).tensor("b").expect_err("must be refused");
    assert_eq!(error.to_string(), "it: has no tensor 'b'");
}

#[test]
fn values_that_are_none() {
    for (value, name) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (f32::NEG_INFINITY, "-inf")] {
        let mut claims = pair();
        claims[0].bytes[12..16].copy_from_slice(&value.to_le_bytes());
        claims[0].bytes[20..24].copy_from_slice(&value.to_le_bytes());
        assert_claims_refused(&claims, &[&format!("tensor 'a.weight': element 3 is {name}, not a finite number")]);
    }
    let header = r#"{"a":{"dtype":"F64","shape":[2],"data_offsets":[0,16]}}"#;
    let bytes = [1.0f64.to_le_bytes(), 1.0e300f64.to_le_bytes()].concat();
    assert_refused(&safetensors(header, &bytes), &["tensor 'a': element 1 is 1e300, which f32 cannot hold"]);
    let tensor = TensorShape { name: "a".to_owned(), shape: vec![2] };
    let computed = Checkpoint::in_memory("it", [(tensor, vec![0.0, f32::NAN])], BTreeMap::new());
    let message = computed.tensor("a").expect_err("must be refused").to_string();
    assert_eq!(message, "it: tensor 'a': element 1 is NaN, not a finite number");
}
