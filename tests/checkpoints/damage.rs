//! Files that are cut off, something else, or wrong about themselves without bad intent.

use super::{assert_claims_refused, assert_refused, pair, read};
use viewfuse_tests::checkpoints::{Claim, Pickle, archive, legacy, legacy_of, safetensors, state_dict, zip};

#[test]
fn cut_off_at_every_byte() {
    let claims = pair();
    let header = r#"{"a":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}}"#;
    let files =
        [archive(&state_dict(&claims), &claims), legacy(&state_dict(&claims), &claims), safetensors(header, &[0; 8])];
    for bytes in files {
        read(&bytes).expect("whole");
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
        }
    }
    assert_refused(&safetensors(header, &[0; 7]), &["the file has 69 bytes; it is cut off or damaged"]);
    let whole = legacy(&state_dict(&claims), &claims);
    assert_refused(&whole[..whole.len() - 1], &["storage 'a.bias': 2 elements of 4 bytes", "it is cut off or damaged"]);
    assert_refused(&whole[..100], &["byte ", "the pickle ends too early"]);
    let whole = archive(&state_dict(&claims), &claims);
    assert_refused(&whole[..whole.len() - 1], &["damaged zip archive", "was the download complete?"]);
}

#[test]
fn something_else() {
    assert_refused(b"", &["not a checkpoint: the file is empty"]);
    assert_refused(b"version https://git-lfs.github.com/spec/v1\noid", &["git-lfs", "`git lfs pull`"]);
    assert_refused(b"\n <!DOCTYPE html><html>", &["a web page"]);
    assert_refused(b"just words\n", &["not a checkpoint: a text"]);
    assert_refused(&[0x89, b'H', b'D', b'F', 13, 10, 26, 10, 0], &["it begins with the bytes 89 48 44 46 0d 0a 1a 0a"]);
    let mut tar = vec![0; 1024];
    tar[..8].copy_from_slice(b"sys_info");
    tar[257..262].copy_from_slice(b"ustar");
    assert_refused(&tar, &["a tar archive"]);
    assert_refused(&zip(&[("a/picture.png".to_owned(), vec![1])], 0), &["a zip archive without data.pkl"]);
    assert_refused(&zip(&[], 0), &["a zip archive without data.pkl"]);
    assert_refused(&Pickle::new().raw(b"}").end(), &["a pickle that torch.save did not write"]);
    let folder = tempfile::tempdir().expect("a folder");
    let message = |path| viewfuse::nn::checkpoint::Checkpoint::open(path).expect_err("must be refused").to_string();
    assert!(message(folder.path()).contains("not a checkpoint: not a file"), "{}", message(folder.path()));
    assert!(message(&folder.path().join("none")).contains("cannot be read: No such file"));
}

#[test]
fn other_byte_orders_and_versions() {
    let claims = pair();
    assert_refused(&legacy_of(false, &state_dict(&claims), &claims), &["big-endian", "save it again"]);
    let content = |name: &str, bytes: &[u8]| (format!("archive/{name}"), bytes.to_vec());
    let pickle = state_dict(&claims);
    let big = zip(&[content("data.pkl", &pickle), content("byteorder", b"big")], 0);
    assert_refused(&big, &["byte order 'big', only 'little' is read"]);
    let program = zip(&[content("data.pkl", &pickle), content("constants.pkl", b"")], 0);
    assert_refused(&program, &["a TorchScript program"]);
    let version = legacy(&pickle, &claims);
    let at = version.windows(3).position(|bytes| bytes == b"M\xe9\x03").expect("the version");
    let mut other = version.clone();
    other[at + 1] = 0xea;
    assert_refused(&other, &["another version than 1001"]);
    assert_refused(&[b"\x80\x09".as_slice(), &version[2..]].concat(), &["byte 0: pickle protocol 9 is not read"]);
}

#[test]
fn no_state_dict() {
    let claims = pair();
    let wrapped = |pickle: Pickle| archive(&pickle.end(), &claims);
    let elsewhere = Pickle::new().raw(b"}(").text("weights").state_dict(&claims).text("epoch").int(1).raw(b"u");
    assert_refused(&wrapped(elsewhere), &["holds no tensors in the expected places", "(it has 'weights', 'epoch')"]);
    assert_refused(&wrapped(Pickle::new().raw(b"]")), &["holds no table of named tensors"]);
    let whole = Pickle::new().global("nets", "Net").raw(b")\x81}(").text("training").raw(b"\x88ub");
    assert_refused(
        &wrapped(whole),
        &["holds an object (nets.Net), not a table of named tensors", "model.state_dict()"],
    );
    let both = Pickle::new().raw(b"}(").text("model").state_dict(&claims).text("a").tensor(&claims[0]).raw(b"u");
    assert_refused(&wrapped(both), &["tensors at its top and also under 'model'"]);
    let twice = [claims[0].clone(), claims[0].clone()];
    assert_claims_refused(&twice, &["two tensors called 'a.weight'"]);
}

#[test]
fn tensors_of_kinds_that_are_not_read() {
    let mut claims = pair();
    claims[1].class = "ComplexFloatStorage";
    assert_refused(&archive(&state_dict(&claims), &claims), &["a.bias", "torch.ComplexFloatStorage"]);
    let sparse = Pickle::new().raw(b"}").text("a").global("torch._utils", "_rebuild_sparse_tensor").raw(b")Rs");
    assert_refused(&archive(&sparse.end(), &[]), &["tensor 'a': ", "torch._utils._rebuild_sparse_tensor"]);
    let header = r#"{"a":{"dtype":"F8_E5M2","shape":[1],"data_offsets":[0,1]}}"#;
    assert_refused(&safetensors(header, &[0]), &["tensor 'a': elements of type F8_E5M2 are not read"]);
}

#[test]
fn storages_that_are_not_there_or_too_short() {
    let mut claims = pair();
    let pickle = state_dict(&claims);
    assert_refused(&archive(&pickle, &claims[..1]), &["tensor 'a.bias': the archive has no entry archive/data/a.bias"]);
    assert_refused(&legacy(&pickle, &claims[..1]), &["tensor 'a.bias': the file does not hold its storage 'a.bias'"]);
    claims[1].bytes.truncate(7);
    let parts = ["tensor 'a.bias'", "2 elements of 4 bytes, but there are 7 bytes"];
    assert_refused(&archive(&pickle, &claims), &parts);
    let mut claims = pair();
    claims[0].first = 1;
    assert_claims_refused(
        &claims,
        &["tensor 'a.weight': shape [2, 3] with strides [3, 1] from element 1 reaches beyond"],
    );
    claims[0].first = 0;
    claims[0].strides = vec![3, 2];
    assert_claims_refused(&claims, &["tensor 'a.weight': ", "reaches beyond storage 'a.weight' of 24 bytes"]);
    claims[0].strides = vec![3];
    assert_claims_refused(&claims, &["tensor 'a.weight': is not described as PyTorch does"]);
}

#[test]
fn headers_of_safetensors() {
    let header = |entry: &str| format!(r#"{{"a":{{"dtype":"F32","shape":[2],"data_offsets":{entry}}}}}"#);
    assert_refused(&safetensors(&header("[0,7]"), &[0; 7]), &["its header is not one of safetensors"]);
    assert_refused(&safetensors(&header("[8,16]"), &[0; 16]), &["its header is not one of safetensors"]);
    assert_refused(&safetensors(&header("[8,0]"), &[0; 8]), &["its header is not one of safetensors"]);
    assert_refused(&safetensors("{\"a\":1}", &[]), &["its header is not one of safetensors"]);
    let overlapping = r#"{"a":{"dtype":"F32","shape":[2],"data_offsets":[0,8]},
        "b":{"dtype":"F32","shape":[2],"data_offsets":[4,12]}}"#;
    assert_refused(&safetensors(overlapping, &[0; 12]), &["its header is not one of safetensors"]);
    let claim = Claim::new("a", &[1], &[1.0]);
    read(&archive(&state_dict(std::slice::from_ref(&claim)), &[claim])).expect("and a right file is read");
}
