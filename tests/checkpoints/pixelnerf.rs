//! PixelNeRF's family of networks: what its metadata say.

use std::path::Path;
use viewfuse::field::pixelnerf::{Architecture, PixelNerf};
use viewfuse::job::progress::Silent;
use viewfuse::nn::checkpoint::{Checkpoint, Precision};
use viewfuse::nn::initialisation;
use viewfuse_tests::places::repository;

/// A small network with this in its metadata.
fn network(metadata: &[(&str, &str)]) -> Checkpoint {
    let metadata = metadata.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
    Checkpoint::computed("it", Architecture::small(16).tensors(), metadata, |tensor| {
        initialisation::tensor(&tensor.name, &tensor.shape)
    })
}

fn saying(key: &str, value: &str) -> Result<Architecture, String> {
    Architecture::of(&network(&[(key, value)])).map_err(|error| error.to_string())
}

/// A small network in a file that says this of itself.
fn written(folder: &Path, place: &str, metadata: &[(&str, &str)]) -> Checkpoint {
    let path = folder.join(place);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
    // The content decides what kind of file it is, not the name.
    network(metadata)
        .write_safetensors(&path.with_extension("safetensors"), Precision::Kept, &Silent)
        .expect("written");
    std::fs::rename(path.with_extension("safetensors"), &path).expect("renamed");
    Checkpoint::open(&path).expect("a checkpoint")
}

#[test]
fn the_folder_of_the_authors_archive_says_what_tensors_do_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let opened = |place: &str, metadata: &[(&str, &str)]| {
        let checkpoint = written(folder.path(), place, metadata);
        let architecture = Architecture::of(&checkpoint).expect("a PixelNeRF");
        // Kept by `convert`.
        let converted = folder.path().join("converted.safetensors");
        checkpoint.write_safetensors(&converted, Precision::Kept, &Silent).expect("written");
        let again = Checkpoint::open(&converted).expect("a checkpoint");
        assert_eq!(Architecture::of(&again).expect("a PixelNeRF"), architecture, "{place}");
        let is_assumed = [&checkpoint, &again].map(|checkpoint| Architecture::assumption(checkpoint).is_some());
        (architecture.has_pool, architecture.source_side, is_assumed)
    };
    for place in ["sn64/pixel_nerf_latest", "sn64_unseen/pixel_nerf_latest", "sn64/pixel_nerf_backup"] {
        assert_eq!(opened(place, &[]), (false, 64, [false; 2]), "{place}");
    }
    for place in ["srn_car/pixel_nerf_latest", "srn_chair/pixel_nerf_backup", "dtu/pixel_nerf_latest"] {
        assert_eq!(opened(place, &[]), (true, 128, [false; 2]), "{place}");
    }
    // What a file says of itself goes before what its folder is called.
    for place in ["sn64/pixel_nerf_latest", "anywhere/network.pth"] {
        assert!(opened(place, &[("viewfuse.first_pool", "1")]).0, "{place}");
        assert!(!opened(place, &[("viewfuse.first_pool", "0")]).0, "{place}");
    }
    let said = saying("viewfuse.first_pool", "2").expect_err("neither");
    assert!(said.contains("viewfuse.first_pool = '2', which is not 0 or 1"), "{said}");
    for (key, value, allowed) in [
        ("frequency", "0", "above 0 and at most 1000"),
        ("frequency", "1e30", "above 0 and at most 1000"),
        ("pixel_centre", "64.5", "from 0 to 1"),
        ("pixel_centre", "-1", "from 0 to 1"),
    ] {
        let said = saying(&format!("viewfuse.{key}"), value).expect_err(value);
        assert!(said.contains(&format!("viewfuse.{key} = '{value}', which is not {allowed}")), "{said}");
    }
}

#[test]
fn what_is_assumed_of_a_network_that_nothing_is_known_of_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let assumed =
        |place: &str, metadata: &[(&str, &str)]| Architecture::assumption(&written(folder.path(), place, metadata));
    for place in ["sn64/other", "other/pixel_nerf_latest", "network.pth"] {
        let said = assumed(place, &[]).expect(place);
        let path = folder.path().join(place).display().to_string();
        for part in [&path, "a max pool in the trunk, sources of 128 pixels", "EXPERIMENT/pixel_nerf_latest"] {
            assert!(said.contains(part), "{said}");
        }
    }
    let said = assumed("network.pth", &[("viewfuse.source_side", "64")]).expect("the pool is not known");
    assert!(said.contains("sources of 64 pixels"), "{said}");
    for key in ["viewfuse.first_pool", "viewfuse.pixel_centre"] {
        assert_eq!(assumed("network.pth", &[(key, "0")]), None, "{key}");
    }
    let included = |name: &str| Checkpoint::open(&repository().join("host/models").join(name)).expect(name);
    for name in ["pixelnerf_cars.safetensors", "genvs_cars.safetensors"] {
        assert_eq!(Architecture::assumption(&included(name)), None, "{name}");
    }
}

/// The included network with a tensor of integers in the place of f16, and with a variance below 0.
#[test]
fn numbers_that_are_no_weights_are_refused() {
    let bytes = std::fs::read(repository().join("host/models/pixelnerf_cars.safetensors")).expect("a network");
    let length = u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes")) as usize;
    let header = std::str::from_utf8(&bytes[8..8 + length]).expect("a header");
    let tensors: serde_json::Value = serde_json::from_str(header).expect("JSON");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("network.safetensors");
    let refused = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("a file");
        let opened = Checkpoint::open(&path).and_then(|checkpoint| PixelNerf::new(&checkpoint, Default::default()));
        opened.err().expect("must be refused").to_string()
    };
    let integers = header.replacen("F16", "I16", 1);
    let said = refused(&[&bytes[..8], integers.as_bytes(), &bytes[8 + length..]].concat());
    assert!(said.contains("holds numbers of type int16, where weights are floating point"), "{said}");
    let name = "encoder.model.bn1.running_var";
    let first = tensors[name]["data_offsets"][0].as_u64().expect("an offset") as usize + 8 + length;
    let mut negative = bytes.clone();
    negative[first + 1] = 0xbc;
    let said = refused(&negative);
    assert!(said.contains(&format!("tensor '{name}': the variance of channel 0 is -1")), "{said}");
}

#[test]
fn the_side_of_sources_is_read_and_one_without_sense_refused() {
    let side = |value| saying("viewfuse.source_side", value).map(|architecture| architecture.source_side);
    assert_eq!(saying("who", "me").map(|architecture| architecture.source_side), Ok(128));
    assert_eq!([side("64"), side("1"), side("65536")], [Ok(64), Ok(1), Ok(65536)]);
    for (value, part) in [
        ("0", "= '0', which is not a whole number from 1 to 65536"),
        ("65537", "not a whole number from 1 to 65536"),
        ("63.5", "viewfuse.source_side = '63.5', which is not a whole number from 1 to 65536"),
        ("NaN", "viewfuse.source_side"),
        ("wide", "viewfuse.source_side"),
    ] {
        let said = side(value).expect_err(value);
        assert!(said.contains(part) && said.contains("it: ") && said.lines().count() == 1, "{value}: {said}");
    }
}
