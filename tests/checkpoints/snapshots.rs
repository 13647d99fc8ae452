//! Networks that Python's pickle wrote as objects.

use super::{assert_refused, data, pair, read};
use viewfuse::nn::checkpoint::Checkpoint;
use viewfuse_tests::checkpoints::{Claim, Pickle, archive, legacy, snapshot};

/// The only module of a file, under the key that snapshots have.
fn holding(module: Pickle) -> Vec<u8> {
    Pickle::new().raw(b"}").text("ema").raw(&module.0).raw(b"s").end()
}

#[test]
fn what_python_wrote() {
    let snapshot = Checkpoint::open(&data("snapshot.pkl")).expect("a snapshot");
    assert_eq!(snapshot.origin(), "pickled network; under 'ema'");
    let truth = Checkpoint::open(&data("snapshot.safetensors")).expect("its state_dict");
    assert_eq!(snapshot.shapes(), truth.shapes());
    assert_eq!(truth.shapes().len(), 17);
    for name in truth.shapes().keys() {
        assert_eq!(snapshot.element(name), truth.element(name), "{name}");
        assert_eq!(snapshot.tensor(name).expect(name), truth.tensor(name).expect(name), "{name}");
    }
    assert_eq!(snapshot.tensor("across").expect("a view"), [0.0, 0.125, 0.25, 0.375, 0.5, 0.625]);
}

#[test]
fn the_same_by_hand() {
    let expected =
        [("a.bias".to_owned(), vec![-1.5, 0.25]), ("a.weight".to_owned(), vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0])];
    let parts: Vec<Claim> =
        pair().into_iter().map(|claim| Claim { name: claim.name.replace("a.", ""), ..claim }).collect();
    let inner = Pickle::default().module(&parts, &[]);
    assert_eq!(read(&holding(Pickle::default().module(&[], &[("a", inner.clone())]))).expect("a snapshot"), expected);
    // The network as the whole of a file; a place that is kept free.
    let free = Pickle::default().raw(b"N");
    let whole = Pickle::new().module(&[], &[("none", free), ("a", inner)]).end();
    assert_eq!(read(&whole).expect("a network"), expected);
    assert_eq!(read(&snapshot(&pair())).expect("a snapshot"), expected);
    // A state_dict that pickle wrote without torch.save.
    let table =
        pair().iter().fold(Pickle::new().raw(b"}("), |table, claim| table.text(&claim.name).nested_tensor(claim));
    assert_eq!(read(&table.raw(b"u").end()).expect("a table"), expected);
    // A network that torch.save wrote.
    let outside = pair()
        .iter()
        .fold(Pickle::new().global("nets", "Net").raw(b")\x81}(").text("_parameters").raw(b"}("), |table, claim| {
            table.text(&claim.name).tensor(claim)
        });
    let outside = outside.raw(b"u").text("_buffers").raw(b"}").text("_modules").raw(b"}ub").end();
    assert_eq!(read(&archive(&outside, &pair())).expect("an archive"), expected);
    assert_eq!(read(&legacy(&outside, &pair())).expect("an old file"), expected);
}

#[test]
fn cut_off_at_every_byte() {
    let bytes = snapshot(&pair());
    read(&bytes).expect("whole");
    for length in 0..bytes.len() {
        assert!(read(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
    }
    assert_refused(&bytes[..bytes.len() - 1], &["byte ", "the pickle ends too early; the file is cut off or damaged"]);
}

#[test]
fn source_text_is_not_executed() {
    let bytes = std::fs::read(data("snapshot.pkl")).expect("a snapshot");
    let text = b"raise SystemExit('the source text in a snapshot was executed')";
    assert_eq!(bytes.windows(text.len()).filter(|window| window == text).count(), 1, "one text for all objects");
    // Nor is it read: it may be anything that is a text.
    let mut other = bytes.clone();
    let at = bytes.windows(text.len()).position(|window| window == text).expect("the text");
    other[at..at + 5].copy_from_slice(b"\0\0\0\0\0");
    assert_eq!(read(&other).expect("a snapshot"), read(&bytes).expect("a snapshot"));
}

#[test]
fn something_else() {
    let numbers = Pickle::new().raw(b"}").text("ema").global("numpy", "ndarray").raw(b")Rs").end();
    assert_refused(&numbers, &["not a checkpoint: a pickle that torch.save did not write and that holds no tensors"]);
    let elsewhere = Pickle::new().raw(b"}").text("G").module(&pair(), &[]).raw(b"s").end();
    assert_refused(&elsewhere, &["holds no tensors in the expected places", "'ema'", "(it has 'G')"]);
    let strange = Pickle::default().global("nets", "Strange").raw(b")R");
    let module = Pickle::default().module(&pair(), &[("odd", strange)]);
    assert_refused(&holding(module), &["module 'odd' (nets.Strange) has no tables of parameters, buffers and modules"]);
    let number = Pickle::new().global("nets", "Net").raw(b")\x81}(").text("_parameters").raw(b"}").text("a").int(1);
    let number = number.raw(b"s").text("_buffers").raw(b"}").text("_modules").raw(b"}").text("m");
    let number = number.raw(&Pickle::default().module(&pair(), &[]).0).raw(b"sub").end();
    assert_refused(&number, &["holds 'a' in place of a tensor"]);
}

#[test]
fn damaged_storages() {
    // The number of elements stands in front of the last 8 bytes, those of the bias.
    let whole = Pickle::default().nested_tensor(&pair()[1]).0;
    let end = whole.windows(4).position(|bytes| bytes == (-1.5f32).to_le_bytes()).expect("the bias");
    let with = |at: usize, byte: u8| {
        let mut bytes = whole.clone();
        bytes[at] = byte;
        Pickle::new().raw(b"}").text("a").raw(&bytes).raw(b"s").end()
    };
    assert_refused(
        &with(end - 8, 3),
        &["the storage in bytes", "storage 'a.bias': has 3 elements, 2 by its description"],
    );
    let magic = whole.windows(2).position(|bytes| bytes == b"\x6c\xfc").expect("the magic number");
    assert_refused(&with(magic, 0), &["the storage in bytes", "does not begin as files of torch.save do"]);
    assert_refused(&with(magic - 4, 0), &["byte ", "opcode 0x00 is not one that torch.save writes"]);
    // A storage that is shorter than the tensor in it.
    let lying = Claim { shape: vec![3], ..pair()[1].clone() };
    assert_refused(&snapshot(&[lying]), &["tensor 'a.bias'", "reaches beyond storage 'a.bias at byte"]);
    let short = Claim { count: 4, ..pair()[1].clone() };
    assert_refused(&snapshot(&[short]), &["the storage in bytes", "4 elements of 4 bytes do not fit between byte"]);
    // No storage at all.
    let none =
        Pickle::new().raw(b"}(").text("a").nested_tensor(&pair()[0]).text("b").tensor(&pair()[1]).raw(b"u").end();
    assert_refused(&none, &["tensor 'b': has no storage"]);
    // A storage outside of the file that it stands in.
    let huge = Claim { count: i64::MAX, ..pair()[1].clone() };
    assert_refused(&snapshot(&[huge]), &["9223372036854775807 elements of 4 bytes do not fit between byte"]);
}

#[test]
fn modules_without_end() {
    // A module that is its own part.
    let contained = Pickle::new().global("nets", "Net").raw(b")\x81q\x00}(").text("_parameters").raw(b"}").text("a");
    let contained = contained.nested_tensor(&pair()[1]).raw(b"s").text("_buffers").raw(b"}").text("_modules").raw(b"}");
    assert_refused(&contained.text("me").raw(b"h\x00sub").end(), &["as if a module contained itself: 'me.me.me."]);
    // Each of 60 modules holds the next twice: 2^60 ways through them, with a tensor at the end or without one.
    for last in [Pickle::default().module(&pair()[1..], &[]), Pickle::default().module(&[], &[])] {
        let doubled = (1..60u8).fold(last.raw(b"q\x00"), |inner, level| {
            let again = Pickle::default().raw(&[b'h', level - 1]);
            Pickle::default().module(&[], &[("a", inner), ("b", again)]).raw(&[b'q', level])
        });
        let module = Pickle::default().module(&pair(), &[("m", doubled)]);
        assert_refused(&holding(module), &["holds the same modules in one another too often"]);
    }
}

#[test]
fn one_tensor_of_two_modules() {
    let shared = Claim::new("weight", &[2], &[1.0, 2.0]);
    let inner = Pickle::default().module(&[shared], &[]).raw(b"q\x00");
    let module = Pickle::default().module(&[], &[("a", inner), ("b", Pickle::default().raw(b"h\x00"))]);
    let names: Vec<String> = read(&holding(module)).expect("a snapshot").into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["a.weight", "b.weight"]);
}
