//! GeNVS's family of networks: sizes are read off the tensors, and what is no member is refused.

use std::collections::BTreeMap;
use viewfuse::field::genvs::{Architecture, Denoiser, DenoiserLevel, Encoder, Estimate, Level, test_networks};
use viewfuse::nn::checkpoint::{Checkpoint, TensorShape};
use viewfuse::nn::initialisation;

/// The tensors of a made network, without values as long as nobody changes them.
struct Tensors {
    shapes: BTreeMap<String, Vec<usize>>,
    values: BTreeMap<String, Vec<f32>>,
    metadata: BTreeMap<String, String>,
}

impl Tensors {
    fn of(architecture: &Architecture) -> Tensors {
        let made = test_networks::deterministic(architecture);
        Tensors { shapes: made.shapes().clone(), values: BTreeMap::new(), metadata: made.metadata().clone() }
    }

    fn small() -> Tensors {
        Tensors::of(&Architecture::small())
    }

    fn with(mut self, name: &str, shape: &[usize]) -> Tensors {
        self.shapes.insert(name.to_owned(), shape.to_vec());
        self
    }

    fn without(mut self, beginning: &str) -> Tensors {
        let count = self.shapes.len();
        self.shapes.retain(|name, _| !name.starts_with(beginning));
        assert!(self.shapes.len() < count, "nothing begins with {beginning}");
        self
    }

    fn filled(mut self, name: &str, shape: &[usize], value: f32) -> Tensors {
        self.values.insert(name.to_owned(), vec![value; shape.iter().product()]);
        self.with(name, shape)
    }

    fn saying(mut self, key: &str, value: &str) -> Tensors {
        self.metadata.insert(key.to_owned(), value.to_owned());
        self
    }

    fn checkpoint(self) -> Checkpoint {
        let tensors = self.shapes.into_iter().map(|(name, shape)| TensorShape { name, shape });
        let values = self.values;
        Checkpoint::computed("it", tensors, self.metadata, move |tensor| {
            values.get(&tensor.name).cloned().unwrap_or_else(|| initialisation::tensor(&tensor.name, &tensor.shape))
        })
    }

    /// Refused in one line that has this in it.
    #[track_caller]
    fn refused(self, part: &str) {
        let message = Architecture::of(&self.checkpoint()).expect_err("must be refused").to_string();
        assert!(message.starts_with("it: ") && !message.contains('\n') && message.len() < 1200, "{message}");
        assert!(message.contains(part), "no {part:?} in: {message}");
    }
}

/// The tensors of a list: a line a module, with the name and the shape of each of its tensors.
fn listed(name: &str) -> Vec<TensorShape> {
    let path = viewfuse_tests::places::data(name);
    let text = std::fs::read_to_string(path).expect("the list");
    let mut listed = Vec::new();
    for line in text.lines() {
        let mut words = line.split(' ');
        let module = words.next().expect("a module");
        while let (Some(leaf), Some(shape)) = (words.next(), words.next()) {
            let shape = shape.split('x').map(|length| length.parse().expect("a length")).collect();
            listed.push(TensorShape { name: format!("{module}.{leaf}"), shape });
        }
    }
    listed
}

#[track_caller]
fn assert_listed(architecture: &Architecture, name: &str) {
    let listed = listed(name);
    for (ours, theirs) in architecture.tensors().iter().zip(&listed) {
        assert_eq!(ours, theirs);
    }
    assert_eq!(architecture.tensors().len(), listed.len());
}

#[test]
fn the_published_network() {
    let published = Architecture::published();
    assert_listed(&published, "genvs_tensors.txt");
    assert_eq!((published.tensors().len(), published.parameter_count()), (950, 102_783_749));
}

/// A file that lost its metadata, as some programs write it again.
#[test]
fn what_is_assumed_of_a_network_is_told() {
    let assumed = |architecture: &Architecture, metadata: &[(&str, &str)]| {
        let mut tensors = Tensors::of(architecture);
        tensors.metadata = metadata.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        let checkpoint = tensors.checkpoint();
        Architecture::of(&checkpoint).expect("a network").assumptions(&checkpoint)
    };
    let said = assumed(&Architecture::small(), &[]).concat();
    assert!(said.starts_with("it: ") && said.contains("write viewfuse.estimate = published"), "{said}");
    let nothing: [String; 0] = [];
    assert_eq!(assumed(&Architecture::published(), &[]), nothing);
    for estimate in ["published", "colours"] {
        assert_eq!(assumed(&Architecture::small(), &[("viewfuse.estimate", estimate)]), nothing, "{estimate}");
    }
    let without = Architecture { denoiser: None, ..Architecture::published() };
    let said = assumed(&without, &[]).concat();
    assert!(said.contains("images of 128 pixels on a side") && said.contains("write viewfuse.image_side"), "{said}");
    assert_eq!(assumed(&without, &[("viewfuse.image_side", "128")]), nothing);
    let made = Tensors::small().metadata;
    assert_eq!(made.get("viewfuse.estimate").map(String::as_str), Some("published"), "it says so itself");
}

#[test]
fn the_small_network() {
    let small = Architecture::small();
    let count = small.parameter_count();
    assert!((1_000_000..5_000_000).contains(&count), "{count}");
    assert_listed(&small, "genvs_small_tensors.txt");
    // All kinds of tensors of the published one are there.
    let kinds = |architecture: &Architecture| {
        let leaf = |name: &str| name.split('.').rev().take(2).collect::<Vec<_>>().join(".");
        let names = architecture.tensors().into_iter().map(|tensor| tensor.name);
        names
            .map(|name| leaf(&name.replace(|c: char| c.is_ascii_digit(), "")))
            .collect::<std::collections::BTreeSet<_>>()
    };
    assert_eq!(kinds(&small), kinds(&Architecture::published()));
}

#[test]
fn sizes_come_from_the_checkpoint() {
    let small = Architecture::small();
    let denoiser = small.denoiser.clone().expect("a denoiser");
    let level = |channels, has_attention| DenoiserLevel { channels, has_attention };
    let trunk = |channels, block_count| Level { channels, block_count };
    let levels = [trunk(4, 1), trunk(4, 2), trunk(12, 3), trunk(8, 1)];
    let other = Encoder {
        stem_channels: 4,
        levels,
        decoder_channels: 10,
        high_resolution_channels: 3,
        ..small.encoder.clone()
    };
    let volume = Encoder { feature_count: 5, volume_depth: 7, ..small.encoder.clone() };
    for architecture in [
        Architecture::published(),
        small.clone(),
        Architecture { encoder: other, mlp_width: 9, ..small.clone() },
        Architecture {
            encoder: volume,
            denoiser: Some(Denoiser { in_channels: 8, ..denoiser.clone() }),
            ..small.clone()
        },
        Architecture { denoiser: None, image_side: 48, ..small.clone() },
        Architecture { denoiser: None, ..Architecture::published() },
        Architecture {
            image_side: 32,
            denoiser: Some(Denoiser {
                image_side: 32,
                base_channels: 8,
                noise_channels: 6,
                embedding_channels: 20,
                levels: vec![level(16, true), level(8, false), level(24, true), level(12, false)],
                block_count: 1,
                ..denoiser.clone()
            }),
            ..small.clone()
        },
        Architecture {
            denoiser: Some(Denoiser { levels: vec![level(4, false)], block_count: 3, ..denoiser }),
            ..small
        },
    ] {
        let checkpoint = test_networks::deterministic(&architecture);
        assert_eq!(Architecture::of(&checkpoint).expect("a member of the family"), architecture);
        let count: usize = checkpoint.shapes().values().map(|shape| shape.iter().product::<usize>()).sum();
        assert_eq!(architecture.parameter_count(), count);
    }
}

#[test]
fn what_real_checkpoints_have_besides_is_accepted() {
    const FILTER: &str = "denoiser.model.enc.32x32_down.conv0.resample_filter";
    let checkpoint = Tensors::small()
        .filled(FILTER, &[1, 1, 2, 2], 0.25)
        .filled("denoiser.model.dec.64x64_up.skip.resample_filter", &[1, 1, 2, 2], 0.25)
        .with("denoiser.model.map_augment.weight", &[32, 6])
        .with("pixel_nerf_net.cam_weighter.query_layer.weight", &[42, 42])
        .with("pixel_nerf_net.cam_weighter.positional_encoder._freqs", &[1, 12, 1])
        .with("pixel_nerf_net.encoder.encoder.bn1.num_batches_tracked", &[])
        .checkpoint();
    let found = Architecture::of(&checkpoint).expect("a member of the family");
    assert_eq!(found, Architecture::small());
    let unused = "it: the weighting of views that it learned, pixel_nerf_net.cam_weighter.*, is not used";
    assert_eq!(found.assumptions(&checkpoint), [unused]);
    Tensors::small()
        .saying("viewfuse.image_side", "32")
        .refused("its metadata says viewfuse.image_side = 32, and its denoiser has images of 64 pixels");
    let other = format!("is no GeNVS: {FILTER}, of shape [1, 1, 4, 4], is not the mean of 2x2 pixels");
    Tensors::small().filled(FILTER, &[1, 1, 4, 4], 0.0625).refused(&other);
    Tensors::small().filled(FILTER, &[1, 1, 2, 2], 0.5).refused("of shape [1, 1, 2, 2], is not the mean of 2x2 pixels");
    // The noise levels of the other variant of the denoiser.
    let fourier = "denoiser.model.map_noise.freqs";
    Tensors::small()
        .with(fourier, &[16])
        .refused("not the tensors of this architecture; unexpected: denoiser.model.map_noise.freqs");
}

#[test]
fn without_a_denoiser() {
    let network = || Tensors::of(&Architecture { denoiser: None, ..Architecture::published() });
    let side = |tensors: Tensors| Architecture::of(&tensors.checkpoint()).map(|architecture| architecture.image_side);
    assert_eq!(side(network()).expect("as it says"), 128);
    assert_eq!(side(network().saying("viewfuse.image_side", "256")).expect("as it says"), 256);
    let unsaid = Tensors { metadata: BTreeMap::new(), ..network() };
    assert_eq!(side(unsaid).expect("as published"), 128);
    network()
        .saying("viewfuse.image_side", "-3")
        .refused("viewfuse.image_side = '-3', which is not a number from 1 to 4096");
    network()
        .saying("viewfuse.image_side", "40")
        .refused("images of 40 pixels on a side; the encoder takes multiples of 16");
    network().with("denoiser.model.map_augment.weight", &[32, 6]).refused("no first convolution that tells the side");
}

#[test]
fn estimates_are_read_and_unknown_ones_refused() {
    let denoiser = |tensors: Tensors| Architecture::of(&tensors.checkpoint()).expect("as it says").denoiser;
    let estimate = |tensors| denoiser(tensors).expect("a denoiser").estimate;
    assert_eq!(estimate(Tensors::small()), Estimate::Published);
    assert_eq!(estimate(Tensors::small().saying("viewfuse.estimate", "colours")), Estimate::FromColours);
    Tensors::small()
        .saying("viewfuse.estimate", "color")
        .refused("its metadata says viewfuse.estimate = 'color'; 'published' and 'colours' are known");
}

#[test]
fn what_is_no_member_is_refused() {
    let nothing = Tensors { shapes: BTreeMap::new(), values: BTreeMap::new(), metadata: BTreeMap::new() };
    nothing.refused("is no GeNVS: it has no tensor pixel_nerf_net.mlp.layers.0.weight");
    let small = Tensors::small;
    for (beginning, said) in [
        ("pixel_nerf_net.encoder.encoder.layer4", "has no tensor pixel_nerf_net.encoder.encoder.layer4.0.conv1.weight"),
        (
            "pixel_nerf_net.encoder.decoder.modified_up.upconv2",
            "missing: pixel_nerf_net.encoder.decoder.modified_up.upconv2.0.weight, \
             pixel_nerf_net.encoder.decoder.modified_up.upconv2.0.bias",
        ),
        ("denoiser.model.enc.64x64_block0", "the denoiser has 0 levels and 0 blocks in the first"),
    ] {
        small().without(beginning).refused(said);
    }
    let first = "pixel_nerf_net.mlp.layers.0.weight";
    let [noise, block] = ["denoiser.model.map_layer0.weight", "denoiser.model.enc.32x32_block0.conv0.weight"];
    let in_groups = "a norm of denoiser.model.enc.32x32_block0 is to take 45 channels in 11 groups of one size";
    for (name, shape, said) in [
        (first, &[32][..], "has the shape [32] instead of 2 dimensions"),
        (first, &[32, 0], "has the size 0 on axis 1; sizes from 1 to 16384 are supported"),
        (first, &[32, 7], "has 512 output channels, not whole voxels of 7 features"),
        (first, &[32, 8], "the denoiser takes 19 channels, not 3 colours and the 8 features"),
        (noise, &[128, 31], "noise levels as 31 numbers, which are not as many cosines as sines"),
        (block, &[45, 32, 3, 3], in_groups),
    ] {
        small().with(name, shape).refused(said);
    }
    let many = (0..80).fold(small(), |tensors, block| {
        tensors.with(&format!("denoiser.model.enc.64x64_block{block}.conv0.weight"), &[32, 32, 3, 3])
    });
    many.refused("3 levels and 80 blocks in the first; at least one of each is needed, and at most 64 blocks");
    let odd = Tensors::of(&Architecture { denoiser: None, ..Architecture::small() })
        .with("denoiser.model.enc.48x48_conv.weight", &[32, 19, 3, 3])
        .with("denoiser.model.enc.48x48_block0.conv0.weight", &[32, 32, 3, 3])
        .with("denoiser.model.map_layer0.weight", &[128, 32]);
    let odd = (1..6).fold(odd, |tensors, level| {
        let side = 48 >> level;
        tensors.with(&format!("denoiser.model.enc.{side}x{side}_block0.conv0.weight"), &[32, 32, 3, 3])
    });
    odd.refused("6 levels, for which 48 pixels cannot be halved often enough");
}
