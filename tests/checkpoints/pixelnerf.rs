//! PixelNeRF's family of networks: what its metadata say.

use std::collections::BTreeMap;
use viewfuse::field::pixelnerf::Architecture;
use viewfuse::nn::checkpoint::Checkpoint;
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
