//! Files that somebody made to do harm: to run something, to take all memory or all time, to overflow a number.

use super::{assert_claims_refused, assert_refused, pair, read};
use viewfuse_tests::checkpoints::{Claim, Pickle, archive, legacy, safetensors, state_dict, zip};

/// A pickle that refers to itself in every way: a name that Python would run at once.
fn attack(function: &str, with: &str) -> Pickle {
    let (module, name) = function.rsplit_once('.').expect("module.name");
    Pickle::new().raw(b"}(").text("gift").global(module, name).text(with).raw(b"\x85R").text("state_dict")
}

#[test]
fn nothing_is_executed() {
    let folder = tempfile::tempdir().expect("a folder");
    let trace = folder.path().join("trace");
    let touch = format!("touch {}", trace.display());
    for function in ["os.system", "posix.system", "builtins.eval", "subprocess.check_output", "nt.system"] {
        let pickle = attack(function, &touch).state_dict(&pair()).raw(b"u").end();
        assert_eq!(read(&archive(&pickle, &pair())).expect("its tensors are read").len(), 2);
        assert_eq!(read(&legacy(&pickle, &pair())).expect("its tensors are read").len(), 2);
        // In place of the function that puts a tensor together, it makes no tensor.
        let (module, name) = function.rsplit_once('.').expect("module.name");
        let pickle = Pickle::new().raw(b"}").text("a").global(module, name).text(&touch).raw(b"\x85Rs").end();
        assert_refused(&archive(&pickle, &[]), &["holds no tensors"]);
        // As the whole.
        let pickle = Pickle::new().global(module, name).text(&touch).raw(b"\x85R").end();
        assert_refused(&archive(&pickle, &[]), &["holds an object", function]);
    }
    assert!(!trace.exists());
}

#[test]
fn absurd_sizes() {
    let huge = |shape: &[i64], strides: &[i64], count: i64| {
        let mut claims = pair();
        claims[0].shape = shape.to_vec();
        claims[0].strides = strides.to_vec();
        claims[0].count = count;
        claims
    };
    let parts = ["tensor 'a.weight'", "would take", "bytes of memory, at most 4294967296 are allowed"];
    let zipped = |claims: &[Claim]| archive(&state_dict(claims), claims);
    assert_refused(&zipped(&huge(&[1 << 60], &[1], 1 << 60)), &parts);
    assert_refused(&zipped(&huge(&[1 << 32, 1 << 32], &[0, 0], 6)), &parts);
    assert_refused(&zipped(&huge(&[i64::MAX, i64::MAX, i64::MAX], &[0, 0, 0], 6)), &parts);
    assert_refused(&zipped(&huge(&[0, i64::MAX, i64::MAX], &[1, 1, 1], 6)), &parts);
    assert_refused(&zipped(&huge(&[1 << 31], &[0], 6)), &parts);
    assert_refused(&zipped(&huge(&[2, 2], &[i64::MAX, i64::MAX], 6)), &["reaches beyond storage"]);
    assert_refused(&zipped(&huge(&[2, 3], &[3, 1], i64::MAX)), &["storage 'a.weight' is to hold 9223372036854775807"]);
    assert_claims_refused(&huge(&[-2, 3], &[3, 1], 6), &["tensor 'a.weight': is not described as PyTorch does"]);
    assert_claims_refused(&huge(&[1; 65], &[1; 65], 6), &["tensor 'a.weight': is not described as PyTorch does"]);
    assert_refused(&legacy(&state_dict(&huge(&[2, 3], &[3, 1], -1)), &pair()), &["storage 'a.weight'", "length"]);
    assert_refused(&legacy(&state_dict(&huge(&[2, 3], &[3, 1], 1 << 62)), &pair()), &["storage 'a.weight'"]);
    // One number, said to be a thousand million of them, as steps of 0 allow.
    assert_refused(
        &zipped(&huge(&[1 << 30], &[0], 6)),
        &["shape [1073741824] has more elements than the 6 of storage 'a.weight'"],
    );
    // Each of so many is allowed, all together are not.
    let many: Vec<Claim> = (0..5000)
        .map(|number| Claim {
            name: format!("t{number}"),
            key: "0".to_owned(),
            shape: vec![1 << 20],
            strides: vec![0],
            ..Claim::new("", &[1], &[1.0])
        })
        .collect();
    let parts = ["all its 5000 tensors would take 20971520000 bytes of memory, at most 17179869184"];
    assert_claims_refused(&many, &parts);
}

#[test]
fn absurd_headers_of_safetensors() {
    let mut file = safetensors("{}", &[]);
    file[..8].copy_from_slice(&100_000_000_000u64.to_le_bytes());
    assert_refused(&file, &["its header is to take 100000000000 bytes, but the file has 10"]);
    file[..8].copy_from_slice(&u64::MAX.to_le_bytes());
    assert_refused(&file, &["its header is to take 18446744073709551615 bytes"]);
    let header = r#"{"a":{"dtype":"F32","shape":[4294967296,4294967296],"data_offsets":[0,0]}}"#;
    assert_refused(&safetensors(header, &[]), &["its header is not one of safetensors"]);
    let header = r#"{"a":{"dtype":"F32","shape":[100000000000],"data_offsets":[0,400000000000]}}"#;
    assert_refused(&safetensors(header, &[]), &["its tensors take 400000000000 bytes"]);
    let header = r#"{"a":{"dtype":"F32","shape":[0,18446744073709551615],"data_offsets":[0,0]}}"#;
    assert_refused(&safetensors(header, &[]), &["bytes of memory"]);
    let nested = format!("{{\"a\":{}{}}}", "[".repeat(100_000), "]".repeat(100_000));
    assert_refused(&safetensors(&nested, &[]), &["its header is not one of safetensors"]);
}

#[test]
fn laughs_by_the_billion() {
    // Each list holds the one before ten times: 10^60 elements for whoever copies them.
    let mut pickle = Pickle::new().raw(b"}(").text("gift").raw(b"]q\x00");
    for level in 0..60u8 {
        let again = [b'h', level].repeat(10);
        pickle = pickle.raw(b"0](").raw(&again).raw(&[b'e', b'q', level + 1]);
    }
    let pickle = pickle.text("state_dict").state_dict(&pair()).raw(b"u").end();
    assert_eq!(read(&archive(&pickle, &pair())).expect("its tensors are read").len(), 2);
}

#[test]
fn cycles() {
    let list = Pickle::new().raw(b"}(").text("gift").raw(b"]q\x00h\x00a").text("state_dict").state_dict(&pair());
    assert_eq!(read(&archive(&list.raw(b"u").end(), &pair())).expect("its tensors are read").len(), 2);
    // A root that is in itself, under the key where tensors are looked for.
    let root = Pickle::new().raw(b"}q\x00(").text("state_dict").raw(b"h\x00u").end();
    assert_refused(&archive(&root, &[]), &["holds no tensors"]);
    // A parameter that is made of itself.
    let made = b"ctorch._utils\n_rebuild_parameter\n]q\x00Rq\x010h\x00h\x01a0h\x01";
    let itself = Pickle::new().raw(b"}").text("a").raw(made).raw(b"s").end();
    assert_refused(
        &archive(&itself, &[]),
        &["tensor 'a': is of a kind that is not read (torch._utils._rebuild_parameter)"],
    );
}

#[test]
fn depth() {
    let depth = 100_000;
    for one in [b"\x85".as_slice(), b"}X\x01\x00\x00\x00kh\x00s", b"cx\ny\nh\x00\x85R"] {
        let mut pickle = Pickle::new().raw(b"}(").text("gift").raw(b"Nq\x00");
        for _ in 0..depth {
            // Each is put around the last.
            pickle = match one {
                b"\x85" => pickle.raw(one),
                _ => pickle.raw(b"q\x000").raw(one),
            };
        }
        let pickle = pickle.text("state_dict").state_dict(&pair()).raw(b"u").end();
        assert_eq!(read(&archive(&pickle, &pair())).expect("its tensors are read").len(), 2);
    }
    assert_refused(&archive(&Pickle::new().raw(&vec![b'('; 600_000]).end(), &[]), &["more than 500000 marks"]);
}

#[test]
fn too_much_of_everything() {
    let file = |body: &[u8]| archive(&Pickle::new().raw(body).end(), &[]);
    assert_refused(&file(&vec![b']'; 600_000]), &["byte ", "more than 500000 values"]);
    assert_refused(&file(&vec![b'N'; 600_000]), &["more than 500000 values on the stack"]);
    assert_refused(&file(&b"N0".repeat(2_100_000)), &["more than 4000000 opcodes"]);
    let text = Pickle::new().text(&"x".repeat(6 << 20)).0;
    assert_refused(&file(&text.repeat(3)), &["more than 16777216 bytes of text"]);
    assert_refused(&file(&[b"c".as_slice(), &vec![b'x'; 5000]].concat()), &["more than 4096 bytes of a name"]);
    let memo: Vec<u8> = (0..600_000u32).flat_map(|number| [b"r".as_slice(), &number.to_le_bytes()].concat()).collect();
    assert_refused(&file(&[b"N".as_slice(), &memo].concat()), &["more than 500000 remembered values"]);
    // Lengths that the file does not have.
    for long in [b"X\xff\xff\xff\xff".as_slice(), b"B\xff\xff\xff\xff", b"\x8b\xff\xff\xff\x7f"] {
        assert_refused(&file(long), &["the pickle ends too early"]);
    }
    for long in [b"\x8d\xff\xff\xff\xff\xff\xff\xff\xff".as_slice(), b"\x8e\xff\xff\xff\xff\xff\xff\xff\x7f"] {
        assert_refused(&file(long), &["the pickle ends too early"]);
    }
}

#[test]
fn opcodes_that_are_none_or_not_applicable() {
    let file = |body: &[u8]| archive(&Pickle::new().raw(body).end(), &[]);
    let start = file(b"").windows(2).position(|bytes| bytes == b"\x80\x02").expect("the pickle") + 2;
    for opcode in [0xffu8, 0x00, b'I', b'S', b'i', b'o', b'P', 0x82, 0x97] {
        assert_refused(&file(&[opcode]), &[&format!("byte {start}: opcode 0x{opcode:02x} is not one that torch.save")]);
    }
    for empty in [b"0".as_slice(), b"a", b"R", b"b", b"s", b"u", b"t", b"\x87", b"\x93", b"Q", b"2", b"q\x00", b""] {
        assert_refused(&file(empty), &["finds too few values on the stack"]);
    }
    assert_refused(&file(b"N(R"), &["finds too few values on the stack"]);
    assert_refused(&file(b"NNa"), &["finds values that it does not apply to"]);
    assert_refused(&file(b"}(Nu"), &["finds values that it does not apply to"]);
    assert_refused(&file(b"NN\x93"), &["finds values that it does not apply to"]);
    assert_refused(&file(b"h\x05"), &["memo 5 was never set"]);
    assert_refused(&file(b"\x8c\x01\xff"), &["not UTF-8"]);
    assert_refused(&file(b"}\x8c\x01aNQs"), &["holds no tensors"]);
}

#[test]
fn archives() {
    let claims = pair();
    let pickle = state_dict(&claims);
    let entry = |name: &str, bytes: &[u8]| (name.to_owned(), bytes.to_vec());
    // Deflated entries can claim any size: none is opened.
    assert_refused(&zip(&[entry("a/data.pkl", &pickle)], 8), &["entry a/data.pkl: is compressed"]);
    let twice = zip(&[entry("a/data.pkl", &pickle), entry("a/data.pkl", b"")], 0);
    assert_refused(&twice, &["two entries of one name"]);
    let two = zip(&[entry("a/data.pkl", &pickle), entry("b/data.pkl", &pickle)], 0);
    assert_refused(&two, &["more than one data.pkl"]);
    // Names are only ever compared, and nothing is unpacked: a path upwards leads nowhere.
    let mut climbing = pair();
    climbing[1].key = "../../../etc/passwd".to_owned();
    let upwards = archive(&state_dict(&climbing), &[]);
    assert_refused(&upwards, &["the archive has no entry archive/data/../../../etc/passwd"]);
    climbing[1].key = "k".repeat(100_000);
    assert_refused(&archive(&state_dict(&climbing), &[]), &["the archive has no entry archive/data/kkkk"]);
    // Sizes in the directory that reach beyond the file.
    let mut file = archive(&pickle, &claims);
    let directory = file.windows(4).position(|bytes| bytes == b"PK\x01\x02").expect("the directory");
    file[directory + 20..directory + 28].copy_from_slice(&[0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff, 0x7f]);
    assert_refused(&file, &["entry archive/data.pkl: reaches beyond the end of the file"]);
}

#[test]
fn names_are_shortened_in_messages() {
    let mut claims = pair();
    claims[0].name = "n".repeat(1 << 20);
    claims[0].first = 9;
    assert_claims_refused(&claims, &["tensor 'nnnn", "nnn…': shape"]);
    claims[0].name = "a\nb\x1b[31m".to_owned();
    assert_claims_refused(&claims, &[r"tensor 'a\nb\u{1b}[31m'"]);
}
