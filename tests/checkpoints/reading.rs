//! Files that PyTorch wrote, and everything that a good file may have.

use super::{assert_refused, data, pair, read};
use std::collections::BTreeMap;
use viewfuse::nn::checkpoint::{Checkpoint, Element};
use viewfuse_tests::checkpoints::{Claim, Pickle, archive, file, legacy, safetensors, state_dict};

/// What the program in `tests/data/checkpoints.md` put into each of its files.
fn truth() -> BTreeMap<&'static str, (Element, Vec<usize>, Vec<f32>)> {
    let range = |count: u8, from: u8| (0..count).map(|number| f32::from(number + from)).collect::<Vec<f32>>();
    let base: Vec<f32> = (0..24u8).map(|number| f32::from(number) / 8.0 - 1.0).collect();
    let mut transposed = Vec::new();
    for x in 0..4 {
        for y in 0..3 {
            transposed.extend([base[4 * y + x], base[12 + 4 * y + x]]);
        }
    }
    let corner = vec![base[16], base[18], base[20], base[22]];
    BTreeMap::from([
        ("0.weight", (Element::F32, vec![2, 1, 3, 3], range(18, 0))),
        ("0.bias", (Element::F32, vec![2], range(2, 1))),
        ("1.weight", (Element::F32, vec![2], range(2, 2))),
        ("1.bias", (Element::F32, vec![2], range(2, 3))),
        ("1.running_mean", (Element::F32, vec![2], range(2, 4))),
        ("1.running_var", (Element::F32, vec![2], range(2, 5))),
        ("1.num_batches_tracked", (Element::I64, vec![], vec![6.0])),
        ("base", (Element::F32, vec![2, 3, 4], base)),
        ("transposed", (Element::F32, vec![4, 3, 2], transposed)),
        ("corner", (Element::F32, vec![2, 2], corner)),
        ("expanded", (Element::F32, vec![3, 2], vec![2.5; 6])),
        ("scalar", (Element::F32, vec![], vec![0.75])),
        ("empty", (Element::F32, vec![0, 3], vec![])),
        ("double", (Element::F64, vec![2], vec![1.5, -2.0])),
        ("half", (Element::F16, vec![2], vec![0.5, -65504.0])),
        ("bfloat", (Element::Bf16, vec![2], vec![1.0, -0.15625])),
        ("int", (Element::I32, vec![2], vec![-7.0, 7.0])),
        ("byte", (Element::U8, vec![2], vec![0.0, 255.0])),
        ("flag", (Element::Bool, vec![2], vec![1.0, 0.0])),
        ("parameter", (Element::F32, vec![2], vec![4.0, 5.0])),
    ])
}

#[test]
fn what_pytorch_wrote() {
    for (name, origin) in [
        ("zip.pth", "PyTorch, zip"),
        ("protocol4.pth", "PyTorch, zip"),
        ("legacy.pth", "PyTorch, before 1.6"),
        ("training.pth", "PyTorch, before 1.6; under 'state_dict'"),
    ] {
        let checkpoint = Checkpoint::open(&data(name)).expect(name);
        assert_eq!(checkpoint.origin(), origin);
        let truth = truth();
        assert!(checkpoint.shapes().keys().eq(truth.keys()), "{name}: {:?}", checkpoint.shapes());
        for (tensor, (element, shape, values)) in truth {
            assert_eq!(checkpoint.shapes().get(tensor), Some(&shape), "{name}: {tensor}");
            assert_eq!(checkpoint.element(tensor), Some(element), "{name}: {tensor}");
            assert_eq!(checkpoint.tensor(tensor).expect(tensor), values, "{name}: {tensor}");
        }
    }
    let training = Checkpoint::open(&data("training.pth")).expect("training.pth");
    let settings = BTreeMap::from([("epoch", "12"), ("note", "a note")].map(|(k, v)| (k.to_owned(), v.to_owned())));
    assert_eq!(training.metadata(), &settings);
}

#[test]
fn every_place_of_the_state_dict() {
    for place in ["state_dict", "model", "model_state_dict", "net", "ema"] {
        let root = Pickle::new().raw(b"}(").text("epoch").int(3).text(place).state_dict(&pair()).raw(b"u");
        let (_folder, path) = file(&archive(&root.end(), &pair()));
        let checkpoint = Checkpoint::open(&path).expect(place);
        assert_eq!(checkpoint.origin(), format!("PyTorch, zip; under '{place}'"));
        assert_eq!(checkpoint.shapes().len(), 2);
    }
    // One without tensors does not count. Of two it is not clear which is meant, nor beside a moving average.
    let both = |other: &str| {
        let root = Pickle::new().raw(b"}(").text(other).state_dict(&pair()[..1]).text("model").state_dict(&pair());
        let root = root.text("state_dict").raw(b"}u").end();
        let (_folder, path) = file(&archive(&root, &pair()));
        Checkpoint::open(&path).map(|file| file.origin().to_owned()).map_err(|error| error.to_string())
    };
    for other in ["best", "schema"] {
        assert_eq!(both(other).expect("a file"), "PyTorch, zip; under 'model'");
    }
    for other in ["net", "ema", "model_ema"] {
        let error = both(other).expect_err(other);
        assert!(error.contains("holds tensors under 'model' and others under") || other == "net", "{error}");
        assert!(error.contains(&format!("'{other}'")) && error.contains("not clear which are meant"), "{error}");
    }
}

#[test]
fn one_state_dict_under_two_keys() {
    let root = Pickle::new().raw(b"}(").text("best").state_dict(&pair()).raw(b"q\x07");
    let root = root.text("model").raw(b"h\x07u").end();
    assert_eq!(read(&archive(&root, &pair())).expect("a file").len(), 2);
}

#[test]
fn prefix_of_data_parallel() {
    let claims = [Claim::new("module.a", &[1], &[1.0]), Claim::new("module.b", &[1], &[2.0])];
    let (_folder, path) = file(&archive(&state_dict(&claims), &claims));
    let checkpoint = Checkpoint::open(&path).expect("a file");
    assert_eq!(checkpoint.shapes().keys().collect::<Vec<_>>(), ["a", "b"]);
    assert_eq!(checkpoint.origin(), "PyTorch, zip; without the 'module.' in front of every name");
    // A network may have a part of that name.
    let claims = [Claim::new("module.a", &[1], &[1.0]), Claim::new("b", &[1], &[2.0])];
    let names = read(&archive(&state_dict(&claims), &claims)).expect("a file");
    assert_eq!(names[1].0, "module.a");
}

/// A tensor's call in its parts: the function, and the arguments as a tuple.
fn call(claim: &Claim) -> (Vec<u8>, Vec<u8>) {
    let function = Pickle::default().global("torch._utils", "_rebuild_tensor_v2").0;
    let tensor = Pickle::default().tensor(claim).0;
    (function.clone(), tensor[function.len()..tensor.len() - 1].to_vec())
}

#[test]
fn buffers_and_tensors_with_attributes() {
    let claim = Claim::new("a", &[2], &[1.0, 2.0]);
    let (function, arguments) = call(&claim);
    let class = Pickle::new().raw(b"}").text("a").global("torch._tensor", "_rebuild_from_type_v2").raw(b"(");
    let class = class.raw(&function).global("torch.nn.parameter", "Buffer").raw(&arguments).raw(b"}tRs");
    assert_eq!(read(&archive(&class.end(), &[claim])).expect("a file"), [("a".to_owned(), vec![1.0, 2.0])]);
}

#[test]
fn what_would_be_lost_or_turned_is_refused() {
    let claims = pair();
    // A network beside the last loss, at the top and in the `state_dict`.
    let table =
        |table: Pickle| table.text("network").state_dict(&claims[..1]).text("loss").tensor(&claims[1]).raw(b"u");
    let top = table(Pickle::new().raw(b"}("));
    let inner = table(Pickle::new().raw(b"}").text("state_dict").raw(b"}(")).raw(b"s");
    for pickle in [top, inner] {
        assert_refused(&archive(&pickle.end(), &claims), &["beside them 'network'", "save model.state_dict()"]);
    }
    let array = Pickle::new().raw(b"}(").text("loss").tensor(&claims[1]).text("b");
    let array = array.global("numpy.core.multiarray", "_reconstruct").raw(b")Ru").end();
    assert_refused(&archive(&array, &claims), &["beside them 'b'", "an array of numpy"]);
    for turned in ["neg", "conj"] {
        let (function, arguments) = call(&claims[1]);
        let tensor = Pickle::new().raw(b"}").text("a").raw(&function).raw(&arguments[..arguments.len() - 1]);
        let tensor = tensor.raw(b"}").text(turned).raw(b"\x88stRs").end();
        assert_refused(&archive(&tensor, &claims), &["tensor 'a': is to be negated or conjugated", "resolve_neg()"]);
    }
    let whole =
        Pickle::new().raw(b"(").text("module").global("nets", "Net").text("net.py").text("class Net").raw(b"tQ");
    assert_refused(&legacy(&whole.end(), &[]), &["a whole network as PyTorch wrote it before 1.6"]);
}

#[test]
fn pairs_as_python_2_gives_them() {
    let claim = Claim::new("a", &[2], &[1.0, 2.0]);
    let pickle = Pickle::new().raw(b"ccollections\nOrderedDict\n](](U\x01a").tensor(&claim).raw(b"ee\x85R");
    assert_eq!(read(&legacy(&pickle.end(), &[claim])).expect("a file"), [("a".to_owned(), vec![1.0, 2.0])]);
}

#[test]
fn views_of_one_storage() {
    let whole = Claim::new("whole", &[2, 3], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    let part = |name: &str, first, shape: &[i64], strides: &[i64]| Claim {
        name: name.to_owned(),
        first,
        shape: shape.to_vec(),
        strides: strides.to_vec(),
        ..whole.clone()
    };
    let claims = [
        part("across", 0, &[3, 2], &[1, 3]),
        part("column", 1, &[2], &[3]),
        part("constant", 5, &[2, 2], &[0, 0]),
        part("last", 3, &[3], &[1]),
        part("none", 6, &[0, 7], &[9, 9]),
    ];
    let expected: [(&str, &[f32]); 5] = [
        ("across", &[0.0, 3.0, 1.0, 4.0, 2.0, 5.0]),
        ("column", &[1.0, 4.0]),
        ("constant", &[5.0; 4]),
        ("last", &[3.0, 4.0, 5.0]),
        ("none", &[]),
    ];
    let expected = expected.map(|(name, values)| (name.to_owned(), values.to_vec()));
    assert_eq!(read(&archive(&state_dict(&claims), &claims)).expect("an archive"), expected);
    assert_eq!(read(&legacy(&state_dict(&claims), &claims)).expect("an old file"), expected);
}

#[test]
fn transposed_and_longer_than_a_piece() {
    let (rows, columns) = (300, 211);
    let values: Vec<f32> = (0..rows * columns).map(|number| number as f32).collect();
    let mut claim = Claim::new("a", &[columns, rows], &values);
    claim.strides = vec![1, columns];
    let read = read(&archive(&state_dict(std::slice::from_ref(&claim)), &[claim])).expect("a file");
    for column in 0..columns {
        for row in 0..rows {
            assert_eq!(read[0].1[(column * rows + row) as usize], (row * columns + column) as f32);
        }
    }
}

#[test]
fn safetensors_with_metadata() {
    let header = r#"{"__metadata__":{"who":"me"},"a":{"dtype":"F16","shape":[2],"data_offsets":[0,4]},
        "b":{"dtype":"I64","shape":[],"data_offsets":[4,12]}}"#;
    let (_folder, path) = file(&safetensors(header, &[0, 60, 0, 192, 7, 0, 0, 0, 0, 0, 0, 0]));
    let checkpoint = Checkpoint::open(&path).expect("a file");
    assert_eq!(checkpoint.tensor("a").expect("a"), [1.0, -2.0]);
    assert_eq!(checkpoint.tensor("b").expect("b"), [7.0]);
    assert_eq!(checkpoint.metadata(), &BTreeMap::from([("who".to_owned(), "me".to_owned())]));
    assert_eq!(checkpoint.origin(), "safetensors");
}

#[test]
fn the_estimate_is_what_reading_takes() {
    let mut claims = pair();
    claims[0].strides = vec![1, 2];
    let (_folder, path) = file(&archive(&state_dict(&claims), &claims));
    let checkpoint = Checkpoint::open(&path).expect("a file");
    const PIECE: u64 = 1 << 16;
    assert_eq!(checkpoint.byte_estimate(["a.bias"]), 8 + PIECE);
    assert_eq!(checkpoint.byte_estimate(["a.bias", "a.weight"]), 8 + 24 + 24 + PIECE, "one is gathered");
    assert_eq!(checkpoint.byte_estimate(["c"]), 0);
}
