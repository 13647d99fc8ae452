//! Checkpoints broken at random: each ends in an error or is read, within its estimate of memory, and without a panic.
//!
//! Memory is counted for the whole process, so that this is one test, in a process of its own.

use super::MEMORY;
use std::path::Path;
use std::time::{Duration, Instant};
use viewfuse::nn::checkpoint::{Checkpoint, OPENING_BYTES};
use viewfuse_tests::alone::alone;
use viewfuse_tests::checkpoints::{Claim, Pickle, archive, file, legacy, safetensors, snapshot, state_dict};
use viewfuse_tests::places::data;

/// Files that are tried.
const ROUNDS: u64 = 20_000;
/// Tensors of files that ask for more are not read here.
const MAX_READ: u64 = 64 << 20;
/// What opening may take: so many bytes for each of the file, and something for every file.
const PER_BYTE: usize = 160;
const ALWAYS: usize = 256 << 10;

/// Random numbers: SplitMix64.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % limit.max(1) as u64) as usize
    }
}

/// What was seen.
#[derive(Debug, Default)]
struct Tally {
    opened: u64,
    read: u64,
    refused: u64,
    most_memory: usize,
    longest: Duration,
}

/// Opens a file and reads it, counting memory; the longest time is only printed.
fn attempt(path: &Path, bytes: &[u8], tally: &mut Tally) {
    // A new file each time: writing over an old one waits for the disk.
    std::fs::remove_file(path).expect("the last file");
    std::fs::write(path, bytes).expect("a file");
    let before = MEMORY.current_usage();
    let peak = || MEMORY.peak_usage().saturating_sub(before);
    MEMORY.reset_peak_usage();
    let start = Instant::now();
    let opened = Checkpoint::open(path);
    let limit = (PER_BYTE * bytes.len() + ALWAYS).min(OPENING_BYTES as usize);
    assert!(peak() <= limit, "opening took {} bytes of memory for a file of {}", peak(), bytes.len());
    tally.most_memory = tally.most_memory.max(peak());
    match opened {
        Err(error) => {
            let message = error.to_string();
            assert!(message.starts_with(&path.display().to_string()) && !message.contains('\n'), "{message}");
            assert!(message.len() < 2000, "{message}");
            tally.refused += 1;
        }
        Ok(checkpoint) => {
            tally.opened += 1;
            for name in checkpoint.shapes().keys() {
                let estimate = checkpoint.byte_estimate([name.as_str()]);
                if estimate <= MAX_READ {
                    let before = MEMORY.current_usage();
                    MEMORY.reset_peak_usage();
                    let outcome = checkpoint.tensor(name);
                    let taken = MEMORY.peak_usage().saturating_sub(before);
                    assert!(taken as u64 <= estimate + 4096, "reading took {taken} bytes, {estimate} were estimated");
                    tally.read += u64::from(outcome.is_ok_and(|values| values.iter().all(|value| value.is_finite())));
                }
            }
        }
    }
    tally.longest = tally.longest.max(start.elapsed());
}

/// A few changes: bits, bytes, numbers with a meaning, opcodes, pieces cut out, doubled or taken from elsewhere.
fn broken(bytes: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    const OPCODES: &[u8] = b"\x80.(0122NJKMGXUTCB]}laeusthjqrcRbQ\x81\x85\x86\x87\x88\x89\x8a\x8b\x8c\x8d\x8e\x8f\x90\x91\x92\x93\x94\x95\x96)";
    const NUMBERS: [u64; 6] = [0, 1, 0x7fff_ffff, 0xffff_ffff, i64::MAX as u64, u64::MAX];
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(2) {
        let at = random.below(bytes.len());
        let length = random.below(40).min(bytes.len() - at);
        match random.below(7) {
            0 if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
            1 if !bytes.is_empty() => bytes[at] = random.below(256) as u8,
            2 => {
                let number = NUMBERS[random.below(NUMBERS.len())].to_le_bytes();
                let width = [1, 2, 4, 8][random.below(4)].min(bytes.len() - at);
                bytes[at..at + width].copy_from_slice(&number[..width]);
            }
            3 => bytes.insert(at, OPCODES[random.below(OPCODES.len())]),
            4 => drop(bytes.drain(at..at + length)),
            5 => {
                let piece = bytes[at..at + length].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, piece);
            }
            _ => {
                let from = random.below(other.len());
                let piece = other[from..(from + length).min(other.len())].to_vec();
                bytes.splice(at..at, piece);
            }
        }
    }
    bytes
}

#[test]
fn broken_at_random() {
    alone("fuzz::broken_at_random", files_broken_at_random);
}

fn files_broken_at_random() {
    let claims = [
        Claim::new("a.weight", &[2, 3], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]),
        Claim { strides: vec![1, 2], ..Claim::new("a.across", &[2, 3], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]) },
        Claim::new("b", &[], &[7.0]),
    ];
    let pickles = [
        state_dict(&claims),
        Pickle::new().raw(b"}(").text("epoch").int(3).text("model").state_dict(&claims).raw(b"u").end(),
    ];
    let header = r#"{"__metadata__":{"k":"v"},"a":{"dtype":"F32","shape":[2,1],"data_offsets":[0,8]},"b":{"dtype":"I64","shape":[],"data_offsets":[8,16]}}"#;
    let mut files = vec![safetensors(header, &[0; 16])];
    for pickle in &pickles {
        files.extend([archive(pickle, &claims), legacy(pickle, &claims)]);
    }
    let folder = data("checkpoints");
    files.push(snapshot(&claims));
    for name in ["zip.pth", "protocol4.pth", "legacy.pth", "training.pth", "snapshot.pkl"] {
        files.push(std::fs::read(folder.join(name)).expect(name));
    }
    let (_folder, path) = file(b"");
    let (mut random, mut tally) = (Random(1), Tally::default());
    for bytes in &files {
        attempt(&path, bytes, &mut tally);
    }
    assert_eq!(tally.opened, files.len() as u64, "whole, each is read");
    for round in 0..ROUNDS {
        let other = &files[random.below(files.len())];
        let bytes = match round % 2 {
            // The whole file, its container included.
            0 => broken(&files[random.below(files.len())], other, &mut random),
            // Only the description, in a container that is right.
            _ => {
                let pickle = broken(&pickles[random.below(pickles.len())], other, &mut random);
                let container = if random.below(2) == 0 { archive } else { legacy };
                container(&pickle, &claims)
            }
        };
        attempt(&path, &bytes, &mut tally);
    }
    println!("{tally:?}");
    assert!(tally.opened > ROUNDS / 20 && tally.refused > ROUNDS / 20, "both ways are tried: {tally:?}");
    // The newest kind once more.
    let (opened, refused) = (tally.opened, tally.refused);
    let snapshots = [snapshot(&claims), files[files.len() - 1].clone()];
    for round in 0..ROUNDS / 5 {
        let other = &files[random.below(files.len())];
        attempt(&path, &broken(&snapshots[round as usize % 2], other, &mut random), &mut tally);
    }
    let (opened, refused) = (tally.opened - opened, tally.refused - refused);
    println!("snapshots: {opened} opened, {refused} refused");
    assert!(opened > ROUNDS / 100 && refused > ROUNDS / 100, "both ways: {opened} opened, {refused} refused");
    files_of_what_grows(&path, &claims, &mut tally);
    println!("{tally:?}");
}

/// Files that are made of what grows most.
fn files_of_what_grows(path: &Path, claims: &[Claim], tally: &mut Tally) {
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
        attempt(path, &archive(&pickle, &[]), tally);
        attempt(path, &legacy(&pickle, &[]), tally);
    }
    // The same storage, and modules in modules, as often as a file of that size can say so.
    let call = Pickle::new().raw(b"}0ctorch.storage\n_load_from_bytes\nq\x01");
    let call = call.bytes(&legacy(&state_dict(claims), claims)).raw(b"\x85q\x02");
    attempt(path, &call.raw(&b"h\x01h\x02R".repeat(100_000)).end(), tally);
    let deep = (0..1000).fold(Pickle::default(), |inner, _| Pickle::default().module(&[], &[("m", inner)]));
    attempt(path, &Pickle::new().raw(&deep.0).end(), tally);
    let names: Vec<String> = (0..1000).map(|number| format!("{number:0>240}")).collect();
    let one = Pickle::default().module(&claims[2..], &[]);
    let wide: Vec<(&str, Pickle)> = names.iter().map(|name| (name.as_str(), one.clone())).collect();
    attempt(path, &Pickle::new().module(&[], &wide).end(), tally);
    let again = Pickle::default().raw(b"h\x00");
    let shared = (0..15).fold(one.raw(b"q\x00"), |inner, _| {
        Pickle::default().module(&[], &[("a", inner), ("b", again.clone())]).raw(b"q\x00")
    });
    attempt(path, &Pickle::new().raw(&shared.0).end(), tally);
    let many: Vec<Claim> = (0..2000).map(|number| Claim::new(&format!("t{number}"), &[1], &[1.0])).collect();
    attempt(path, &archive(&state_dict(&many), &many), tally);
    attempt(path, &legacy(&state_dict(&many), &many), tally);
}
