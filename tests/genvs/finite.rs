//! Numbers that are none are found where they arise: at the border of the stage that made them, which the error names.

use crate::{exact, sources, target, try_picture};
use std::collections::BTreeMap;
use viewfuse::checkpoint::{Checkpoint, TensorShape};
use viewfuse::field::FieldError;
use viewfuse::field::finite::NotFinite;
use viewfuse::field::genvs::{Architecture, Genvs, made};
use viewfuse::photographs::SourceImages;
use viewfuse_core::weights::Weights;

/// The small network with the values of one tensor multiplied.
fn multiplied(name: &str, factor: f32) -> Genvs {
    let made = made::by_formula(&Architecture::small());
    assert!(made.shapes().contains_key(name), "{name}");
    let shapes = made.shapes().iter();
    let shapes: Vec<TensorShape> =
        shapes.map(|(name, shape)| TensorShape { name: name.clone(), shape: shape.clone() }).collect();
    let name = name.to_owned();
    let checkpoint = Checkpoint::computed("changed", shapes, BTreeMap::new(), move |tensor| {
        let mut values = made.tensor(&tensor.name).expect("values");
        if tensor.name == name {
            values.iter_mut().for_each(|value| *value *= factor);
        }
        values
    });
    Genvs::new(checkpoint, exact()).expect("a made network")
}

#[track_caller]
fn not_finite(field: &Genvs, sources: &SourceImages) -> NotFinite {
    let weights = Weights::mean(sources.images.len() as u32);
    match try_picture(field, sources, &weights, &target(16)) {
        Err(FieldError::NotFinite(error)) => {
            println!("{error}");
            assert!(!error.value.is_finite());
            error
        }
        other => panic!("{other:?}"),
    }
}

const VOLUME: &str = "volume [row][column][depth][feature]";

/// What overflows in any layer of the encoder is still to be seen in its volume.
#[test]
fn in_the_encoder() {
    for name in [
        "encoder.conv1",
        "encoder.layer1.0.conv1",
        "encoder.layer2.0.downsample.0",
        "encoder.layer4.1.conv2",
        "decoder.aspp.0.convs.0.0",
        "decoder.aspp.0.convs.2.0.0",
        "decoder.aspp.0.convs.4.1",
        "decoder.aspp.0.project.0",
        "decoder.modified_up.stage2.2",
        "decoder.modified_up.upconv1.0",
        "decoder.block1.0",
        "volume_head.up.upconv2.0",
        "volume_head.up.stage2.4",
        "volume_head.reshape_conv",
    ] {
        let field = multiplied(&format!("pixel_nerf_net.encoder.{name}.weight"), 3.0e38);
        let error = not_finite(&field, &sources(2));
        assert_eq!((error.stage.as_str(), error.tensor.as_str()), ("encoding source 0", VOLUME), "{name}");
    }
}

#[test]
fn in_the_network_at_points() {
    for layer in 0..3 {
        let error = not_finite(&multiplied(&format!("pixel_nerf_net.mlp.layers.{layer}.weight"), 3.0e38), &sources(2));
        assert_eq!(error.stage, "rendering the target's features", "{layer}");
        assert_eq!(error.tensor, "feature image");
    }
}

#[test]
fn in_the_denoiser() {
    for name in [
        "map_layer0",
        "map_layer1",
        "enc.64x64_conv",
        "enc.64x64_block0.conv0",
        "enc.32x32_aux_residual",
        "enc.16x16_block0.qkv",
        "dec.16x16_in0.norm2",
        "dec.32x32_up.skip",
        "dec.64x64_aux_norm",
        "dec.64x64_aux_conv",
    ] {
        let error = not_finite(&multiplied(&format!("denoiser.model.{name}.weight"), 3.0e38), &sources(2));
        assert_eq!(
            (error.stage.as_str(), error.tensor.as_str()),
            ("denoising at level 80", "denoised picture"),
            "{name}"
        );
    }
}

#[test]
fn in_a_photograph() {
    for bad in [f32::NAN, f32::INFINITY] {
        let mut sources = sources(2);
        sources.images[1].texels[5][1] = bad;
        let field = multiplied("denoiser.model.map_layer0.weight", 1.0);
        let error = not_finite(&field, &sources);
        assert_eq!((error.stage.as_str(), error.index), ("encoding source 1", 5 * 3 + 1));
        assert_eq!(error.tensor, "image [row][column][3]");
    }
}
