//! What opening a checkpoint takes of memory, for files that are made of what grows most: no more than their bytes say.
//! Files that are broken at random are a target of `fuzz`.
//!
//! Memory is counted for the whole process, so that this is one test, in a process of its own.

use super::MEMORY;
use std::path::Path;
use viewfuse::nn::checkpoint::{Checkpoint, OPENING_BYTES};
use viewfuse_tests::alone::alone;
use viewfuse_tests::checkpoints::{Claim, Pickle, archive, file, legacy, state_dict};

/// What opening may take: so many bytes for each of the file, and something for every file.
const PER_BYTE: usize = 160;
const ALWAYS: usize = 256 << 10;

/// Opens a file, counting memory.
fn attempt(path: &Path, bytes: &[u8]) {
    std::fs::write(path, bytes).expect("a file");
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let opened = Checkpoint::open(path);
    let peak = MEMORY.peak_usage().saturating_sub(before);
    let limit = (PER_BYTE * bytes.len() + ALWAYS).min(OPENING_BYTES as usize);
    assert!(peak <= limit, "opening took {peak} bytes of memory for a file of {}", bytes.len());
    if let Err(error) = opened {
        let message = error.to_string();
        assert!(message.starts_with(&path.display().to_string()) && !message.contains('\n'), "{message}");
        assert!(message.len() < 2000, "{message}");
    }
}

#[test]
fn what_grows_stays_small() {
    alone("memory::what_grows_stays_small", files_of_what_grows);
}

fn files_of_what_grows() {
    let (_folder, path) = file(b"");
    let claims = [Claim::new("a", &[2, 3], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]), Claim::new("b", &[], &[7.0])];
    for one in [
        b"]".as_slice(),
        b"}",
        b"N",
        b"h\x00",
        b"(",
        b"\x85",
        b"NN\x86",
        b"cA\nB\n",
        b")R",
        b"q\x01",
        b"\x94",
        b"K\x01",
    ] {
        let pickle = Pickle::new().raw(b"Nq\x00").raw(&one.repeat(400_000)).end();
        attempt(&path, &archive(&pickle, &[]));
        attempt(&path, &legacy(&pickle, &[]));
    }
    // The same storage, and modules in modules, as often as a file of that size can say so.
    let call = Pickle::new().raw(b"}0ctorch.storage\n_load_from_bytes\nq\x01");
    let call = call.bytes(&legacy(&state_dict(&claims), &claims)).raw(b"\x85q\x02");
    attempt(&path, &call.raw(&b"h\x01h\x02R".repeat(100_000)).end());
    let deep = (0..1000).fold(Pickle::default(), |inner, _| Pickle::default().module(&[], &[("m", inner)]));
    attempt(&path, &Pickle::new().raw(&deep.0).end());
    let names: Vec<String> = (0..1000).map(|number| format!("{number:0>240}")).collect();
    let one = Pickle::default().module(&claims[1..], &[]);
    let wide: Vec<(&str, Pickle)> = names.iter().map(|name| (name.as_str(), one.clone())).collect();
    attempt(&path, &Pickle::new().module(&[], &wide).end());
    let again = Pickle::default().raw(b"h\x00");
    let shared = (0..15).fold(one.raw(b"q\x00"), |inner, _| {
        Pickle::default().module(&[], &[("a", inner), ("b", again.clone())]).raw(b"q\x00")
    });
    attempt(&path, &Pickle::new().raw(&shared.0).end());
    let many: Vec<Claim> = (0..2000).map(|number| Claim::new(&format!("t{number}"), &[1], &[1.0])).collect();
    attempt(&path, &archive(&state_dict(&many), &many));
    attempt(&path, &legacy(&state_dict(&many), &many));
}
