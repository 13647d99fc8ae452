//! Checkpoints of every format, and learned attention.

use super::{OneFile, Target, Verdict, verdict};
use crate::memory;
use viewfuse::nn::checkpoint::Checkpoint;
use viewfuse::weighting::attention::AttentionModel;
use viewfuse_tests::checkpoints::{Claim, Pickle, archive, legacy, safetensors, snapshot, state_dict};
use viewfuse_tests::command;
use viewfuse_tests::places::data;

/// Tensors of files that ask for more are not read here.
const MAX_READ: u64 = 64 << 20;
/// What opening may take: so many bytes for each of the file, and something for every file.
const PER_BYTE: usize = 160;
const ALWAYS: usize = 256 << 10;
/// Bytes of a container around a pickle.
const CONTAINER: usize = 4096;
/// What reading a tensor may take beside its estimate.
const MESSAGE: u64 = 4096;

/// Whether no more memory was taken than may be since so much was.
fn within(before: usize, most: u64, what: &str) -> Result<(), String> {
    let taken = memory::since_start()[0].saturating_sub(before) as u64;
    if taken <= most { Ok(()) } else { Err(format!("{what} took {taken} bytes, of at most {most}")) }
}

pub(crate) struct Checkpoints {
    file: OneFile,
    seeds: Vec<Vec<u8>>,
    words: &'static [&'static str],
    /// Whether an input is a pickle alone, to be put into a container that is right.
    has_container: bool,
}

fn claims() -> [Claim; 3] {
    [
        Claim::new("a.weight", &[2, 3], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]),
        Claim { strides: vec![1, 2], ..Claim::new("a.across", &[2, 3], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]) },
        Claim::new("b", &[], &[7.0]),
    ]
}

fn pickles_of(claims: &[Claim]) -> [Vec<u8>; 2] {
    let nested = Pickle::new().raw(b"}(").text("epoch").int(3).text("model").state_dict(claims).raw(b"u").end();
    [state_dict(claims), nested]
}

impl Checkpoints {
    fn new(seeds: Vec<Vec<u8>>, words: &'static [&'static str], has_container: bool) -> Checkpoints {
        Checkpoints { file: OneFile::new("checkpoint"), seeds, words, has_container }
    }

    pub(crate) fn safetensors() -> Checkpoints {
        let header = r#"{"__metadata__":{"k":"v"},"a":{"dtype":"F32","shape":[2,1],"data_offsets":[0,8]},"b":{"dtype":"I64","shape":[],"data_offsets":[8,16]}}"#;
        let words =
            &["\"dtype\":\"F16\"", "\"shape\":[1000000,1000000]", "\"data_offsets\":[0,0]", "[", "]", "{", "}", "BF16"];
        Checkpoints::new(vec![safetensors(header, &[0; 16])], words, false)
    }

    /// The description of the tensors, in a container that is right.
    pub(crate) fn pickles() -> Checkpoints {
        let words = &[
            "\u{0}", "(", ")", ".", "]", "}", "R", "a", "b", "e", "h\u{0}", "q\u{1}", "s", "u", "t", "cos\nsystem\n",
            "K\u{1}",
        ];
        Checkpoints::new(pickles_of(&claims()).to_vec(), words, true)
    }

    /// Whole files.
    pub(crate) fn files() -> Checkpoints {
        let claims = claims();
        let mut seeds = vec![snapshot(&claims)];
        for pickle in pickles_of(&claims) {
            seeds.extend([archive(&pickle, &claims), legacy(&pickle, &claims)]);
        }
        for name in ["zip.pth", "protocol4.pth", "legacy.pth", "training.pth", "snapshot.pkl"] {
            seeds.push(std::fs::read(data("checkpoints").join(name)).expect(name));
        }
        seeds.retain(|seed| seed.len() <= crate::change::LONGEST);
        Checkpoints::new(seeds, &["PK\u{3}\u{4}", "PK\u{1}\u{2}", "PK\u{5}\u{6}"], false)
    }
}

impl Target for Checkpoints {
    fn seeds(&self) -> Vec<Vec<u8>> {
        self.seeds.clone()
    }

    fn words(&self) -> &'static [&'static str] {
        self.words
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        let path = match (self.has_container, bytes.len() % 2) {
            (false, _) => self.file.write(bytes),
            (true, 0) => self.file.write(&archive(bytes, &claims())),
            (true, _) => self.file.write(&legacy(bytes, &claims())),
        };
        let before = memory::start();
        let opened = Checkpoint::open(path);
        within(before, (PER_BYTE * (bytes.len() + CONTAINER) + ALWAYS) as u64, "opening")?;
        if let Ok(checkpoint) = &opened {
            for name in checkpoint.shapes().keys() {
                let estimate = checkpoint.byte_estimate([name.as_str()]);
                if estimate <= MAX_READ {
                    let before = memory::start();
                    let outcome = checkpoint.tensor(name);
                    within(before, estimate + MESSAGE, "reading")?;
                    verdict(outcome, path)?;
                }
            }
        }
        verdict(opened, path)
    }
}

pub(crate) struct Attention(pub(super) OneFile);

impl Target for Attention {
    fn seeds(&self) -> Vec<Vec<u8>> {
        let zeros = |tensors: &[(&str, &[usize])]| {
            let bytes = |shape: &[usize]| vec![0; 4 * shape.iter().product::<usize>()];
            let all = tensors.iter().map(|(name, shape)| (*name, "F32", *shape, bytes(shape)));
            command::safetensors(&all.collect::<Vec<_>>())
        };
        let n = viewfuse_core::attention::POSE_FEATURES;
        vec![
            zeros(&[("query_layer.weight", &[n, n]), ("key_layer.weight", &[n, n])]),
            zeros(&[("paper.0.weight", &[4, 4]), ("paper.0.bias", &[4])]),
            zeros(&[("multihead_attention.in_proj_weight", &[36, 12])]),
        ]
    }

    fn words(&self) -> &'static [&'static str] {
        &["paper.0.weight", "paper_flat.0.weight", "query_layer.weight", "F16", "[0]", "[4294967296,4294967296]"]
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        let path = self.0.write(bytes);
        verdict(AttentionModel::open(path), path)
    }
}
