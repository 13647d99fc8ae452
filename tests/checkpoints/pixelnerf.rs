//! PixelNeRF's family of networks: what its metadata say.

use std::f32::consts::FRAC_PI_2;
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
    for (place, side) in
        [("srn_car/pixel_nerf_latest", 128), ("srn_chair/pixel_nerf_backup", 128), ("dtu/pixel_nerf_latest", 400)]
    {
        assert_eq!(opened(place, &[]), (true, side, [false; 2]), "{place}");
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
    // What it says is not assumed, and all the rest is.
    let [pool, centre, side] = ["viewfuse.first_pool", "viewfuse.pixel_centre", "viewfuse.source_side"];
    let said = assumed("network.pth", &[(side, "64")]).expect("the pool is not known");
    assert!(said.contains("a max pool") && said.contains("centres at 0") && !said.contains("128 pixels"), "{said}");
    let said = assumed("network.pth", &[(pool, "1")]).expect("the side is not known");
    assert!(said.contains(&format!("into it: {side}, {centre}")) && !said.contains("a max pool"), "{said}");
    // The laboratory's older networks have a pool and do not say so.
    let said = assumed("network.pth", &[(centre, "0.5")]).expect("the side is not known");
    assert!(said.ends_with(&format!("into it: {side}")), "{said}");
    assert_eq!(assumed("network.pth", &[(centre, "0"), (side, "64")]), None);
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

/// Tables of octaves and phases, and more octaves than any network that was published has.
#[test]
fn what_contradicts_itself_is_refused() {
    let frequency = |octaves: usize, tables: &[(&str, &[f32])], metadata: &[(&str, &str)]| {
        let mut architecture = Architecture::small(16);
        architecture.frequency_count = octaves;
        let shape = |(name, values): &(&str, &[f32])| viewfuse::nn::checkpoint::TensorShape {
            name: (*name).to_owned(),
            shape: vec![1, values.len(), 1],
        };
        let shapes: Vec<_> = architecture.tensors().into_iter().chain(tables.iter().map(shape)).collect();
        let tables: Vec<(String, Vec<f32>)> =
            tables.iter().map(|(name, values)| ((*name).to_owned(), values.to_vec())).collect();
        let metadata = metadata.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        let checkpoint = Checkpoint::computed("it", shapes, metadata, move |tensor| {
            let table = tables.iter().find(|(name, _)| *name == tensor.name).map(|(_, values)| values.clone());
            table.unwrap_or_else(|| initialisation::tensor(&tensor.name, &tensor.shape))
        });
        Architecture::of(&checkpoint).map(|found| found.frequency).map_err(|error| error.to_string())
    };
    let (frequencies, phases) =
        (("code._freqs", [3.0, 3.0, 6.0, 6.0]), ("code._phases", [0.0, FRAC_PI_2, 0.0, FRAC_PI_2]));
    let tables: [(&str, &[f32]); 2] = [(frequencies.0, &frequencies.1), (phases.0, &phases.1)];
    assert_eq!(frequency(2, &tables, &[]), Ok(3.0));
    assert_eq!(frequency(2, &tables, &[("viewfuse.frequency", "3")]), Ok(3.0));
    let said = frequency(2, &tables, &[("viewfuse.frequency", "1.5")]).expect_err("another frequency");
    assert!(said.contains("viewfuse.frequency = 1.5, and code._freqs begins with 3"), "{said}");
    for wrong in [&[FRAC_PI_2, 0.0, FRAC_PI_2, 0.0][..], &[0.0, FRAC_PI_2]] {
        let said = frequency(2, &[tables[0], (phases.0, wrong)], &[]).expect_err("other phases");
        assert!(said.contains("code._phases does not hold 0 and pi/2 in turns for 2 octaves"), "{said}");
    }
    // Six octaves of points and of directions have as many inputs.
    let said = frequency(12, &[], &[]).expect_err("directions, perhaps");
    assert!(said.contains("78 numbers a point") && said.contains("use_code_viewdirs"), "{said}");
    assert_eq!(frequency(12, &[], &[("viewfuse.frequency", "1.5")]), Ok(1.5));
    assert_eq!(frequency(6, &[], &[]), Ok(1.5));
}
