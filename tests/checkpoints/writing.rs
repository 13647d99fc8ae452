//! Writing safetensors: what comes back, what the crate of that name says, and that nothing is left behind.

use super::{data, pair};
use safetensors::SafeTensors;
use std::collections::BTreeMap;
use viewfuse::job::progress::Silent;
use viewfuse::nn::checkpoint::{Checkpoint, Element, Precision, TensorShape};
use viewfuse_tests::checkpoints::{archive, file, state_dict};

#[test]
fn what_pytorch_wrote_comes_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("new/file.safetensors");
    for name in ["zip.pth", "training.pth"] {
        let before = Checkpoint::open(&data(name)).expect(name);
        let written = before.write_safetensors(&path, Precision::Kept, &Silent).expect("written");
        let after = Checkpoint::open(&path).expect("opened");
        assert_eq!((after.shapes(), after.metadata()), (before.shapes(), before.metadata()));
        for tensor in before.shapes().keys() {
            assert_eq!(after.element(tensor), before.element(tensor));
            assert_eq!(after.tensor(tensor).expect("read"), before.tensor(tensor).expect("read"), "{tensor}");
        }
        let bytes = std::fs::read(&path).expect("the file");
        assert_eq!(written.bytes, bytes.len() as u64);
        let file = SafeTensors::deserialize(&bytes).expect("as its own crate reads it");
        assert_eq!(file.len(), before.shapes().len());
        for (tensor, view) in file.iter() {
            let offset = view.data().as_ptr() as usize - bytes.as_ptr() as usize;
            let size = before.element(tensor).map_or(1, Element::size);
            assert_eq!(offset % size, 0, "{tensor} is aligned");
        }
    }
}

#[test]
fn in_half_precision() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("half.safetensors");
    let tensor = |name: &str, values: &[f32]| {
        (TensorShape { name: name.to_owned(), shape: vec![values.len()] }, values.to_vec())
    };
    // Halfway between 1 and its neighbour 1 + 2^-10, and a third of the smallest number in half precision.
    let tensors = [tensor("a", &[1.0 + 0.5f32.powi(11), 65504.0]), tensor("b", &[0.5f32.powi(24) / 3.0, 0.0])];
    let checkpoint = Checkpoint::in_memory("it", tensors, BTreeMap::new());
    let written = checkpoint.write_safetensors(&path, Precision::Half, &Silent).expect("written");
    let expected = 0.5f64.powi(11) / (1.0 + 0.5f64.powi(11));
    assert!((written.relative_error - expected).abs() < 1.0e-12, "{written:?}");
    assert_eq!(written.tiny_count, 1);
    assert!((written.tiny_error - 0.5f64.powi(24) / 3.0).abs() < 1.0e-12, "{written:?}");
    let after = Checkpoint::open(&path).expect("opened");
    assert_eq!(after.element("a"), Some(Element::F16));
    assert_eq!(after.tensor("a").expect("a"), [1.0, 65504.0]);
    assert_eq!(after.tensor("b").expect("b"), [0.0, 0.0]);
    // Integers stay what they are.
    let whole = Checkpoint::open(&data("zip.pth")).expect("a checkpoint");
    whole.write_safetensors(&path, Precision::Half, &Silent).expect("written");
    let after = Checkpoint::open(&path).expect("opened");
    assert_eq!(after.element("1.num_batches_tracked"), Some(Element::I64));
    assert_eq!(after.element("double"), Some(Element::F16));
}

/// Writing fails with these words and leaves nothing.
#[track_caller]
fn assert_not_written(checkpoint: &Checkpoint, precision: Precision, part: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let outcome = checkpoint.write_safetensors(&folder.path().join("out.safetensors"), precision, &Silent);
    let message = outcome.expect_err("must fail").to_string();
    assert!(message.contains(part), "{message}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0, "nothing is left");
}

#[test]
fn nothing_is_left_of_what_cannot_be_written() {
    let one = |shape: &[usize], values: &[f32]| {
        let tensor = TensorShape { name: "a".to_owned(), shape: shape.to_vec() };
        Checkpoint::in_memory("it", [(tensor, values.to_vec())], BTreeMap::new())
    };
    let large = one(&[3], &[1.0, -65520.0, 65520.0]);
    assert_not_written(&large, Precision::Half, "it: tensor 'a': element 1 is -65520.0, which f16 cannot hold");
    assert_not_written(&one(&[2], &[0.0, f32::NAN]), Precision::Kept, "tensor 'a': element 1 is NaN");
    assert_not_written(&one(&[3], &[0.0, 1.0]), Precision::Kept, "tensor 'a' has 2 values, not those of its shape");
    let mut claims = pair();
    claims[1].bytes[..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let (_folder, path) = file(&archive(&state_dict(&claims), &claims));
    assert_not_written(&Checkpoint::open(&path).expect("opened"), Precision::Half, "tensor 'a.bias': element 0 is inf");
    claims[1].name = "__metadata__".to_owned();
    let (_folder, path) = file(&archive(&state_dict(&claims), &claims));
    assert_not_written(&Checkpoint::open(&path).expect("opened"), Precision::Kept, "'__metadata__'");
}

#[test]
fn a_file_in_place_of_itself() {
    let claims = pair();
    let (_folder, path) = file(&archive(&state_dict(&claims), &claims));
    let checkpoint = Checkpoint::open(&path).expect("opened");
    checkpoint.write_safetensors(&path, Precision::Kept, &Silent).expect("written");
    assert_eq!(Checkpoint::open(&path).expect("opened").origin(), "safetensors");
}
