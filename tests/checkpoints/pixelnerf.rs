//! PixelNeRF's family of networks: what its metadata say.

use std::collections::BTreeMap;
use viewfuse::field::pixelnerf::{Architecture, test_networks};
use viewfuse::job::progress::Silent;
use viewfuse::nn::checkpoint::{Checkpoint, Precision};
use viewfuse::nn::initialisation;

/// A small network with this in its metadata.
fn saying(key: &str, value: &str) -> Result<Architecture, String> {
    let small = Architecture::small(16);
    let metadata: BTreeMap<String, String> = [(key.to_owned(), value.to_owned())].into();
    let checkpoint = Checkpoint::computed("it", small.tensors(), metadata, |tensor| {
        initialisation::tensor(&tensor.name, &tensor.shape)
    });
    Architecture::of(&checkpoint).map_err(|error| error.to_string())
}

#[test]
fn the_folder_of_the_authors_archive_says_what_tensors_do_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let small = test_networks::deterministic(&Architecture::small(16));
    let opened = |place: &str| {
        let path = folder.path().join(place);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        // The content decides what kind of file it is, not the name.
        small.write_safetensors(&path.with_extension("safetensors"), Precision::Kept, &Silent).expect("written");
        std::fs::rename(path.with_extension("safetensors"), &path).expect("renamed");
        let checkpoint = Checkpoint::open(&path).expect("a checkpoint");
        let architecture = Architecture::of(&checkpoint).expect("a PixelNeRF");
        // Kept by `convert`.
        let converted = folder.path().join("converted.safetensors");
        checkpoint.write_safetensors(&converted, Precision::Kept, &Silent).expect("written");
        let again = Architecture::of(&Checkpoint::open(&converted).expect("a checkpoint")).expect("a PixelNeRF");
        assert_eq!(again, architecture, "{place}");
        (architecture.has_pool, architecture.source_side)
    };
    for place in ["sn64/pixel_nerf_latest", "sn64_unseen/pixel_nerf_latest", "sn64/pixel_nerf_backup"] {
        assert_eq!(opened(place), (false, 64), "{place}");
    }
    for place in ["srn_car/pixel_nerf_latest", "sn64/other", "dtu/pixel_nerf_latest"] {
        assert_eq!(opened(place), (true, 128), "{place}");
    }
    assert_eq!(saying("viewfuse.first_pool", "0").map(|architecture| architecture.has_pool), Ok(false));
    let said = saying("viewfuse.first_pool", "2").expect_err("neither");
    assert!(said.contains("viewfuse.first_pool = 2, which is neither 0 nor 1"), "{said}");
}

#[test]
fn the_side_of_sources_is_read_and_one_without_sense_refused() {
    let side = |value| saying("viewfuse.source_side", value).map(|architecture| architecture.source_side);
    assert_eq!(saying("who", "me").map(|architecture| architecture.source_side), Ok(128));
    assert_eq!([side("64"), side("1"), side("65536")], [Ok(64), Ok(1), Ok(65536)]);
    for (value, part) in [
        ("0", "not a whole number from 1 to 65536"),
        ("65537", "not a whole number from 1 to 65536"),
        ("63.5", "viewfuse.source_side = 63.5"),
        ("NaN", "viewfuse.source_side"),
        ("wide", "viewfuse.source_side"),
    ] {
        let said = side(value).expect_err(value);
        assert!(said.contains(part) && said.contains("it: ") && said.lines().count() == 1, "{value}: {said}");
    }
}
