//! NaN and infinity are reported at the stage that produced them, which the error names.

use super::{exact, sources, target, try_picture};
use viewfuse::field::FieldError;
use viewfuse::field::finite::NotFinite;
use viewfuse::field::genvs::{Architecture, Genvs, test_networks};
use viewfuse::scene::photographs::SourceImages;
use viewfuse_core::weights::Weights;
use viewfuse_tests::checkpoints::{LARGE, multiplied};

/// The small network with all weights of a module, or of a layer, multiplied.
fn with_module(module: &str, factor: f32) -> Genvs {
    let made = test_networks::deterministic(&Architecture::small());
    let belongs =
        |name: &str| name.strip_prefix(module).is_some_and(|rest| rest.starts_with('.') && rest.ends_with(".weight"));
    Genvs::new(multiplied(&made, belongs, factor), exact()).expect("a made network")
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
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("a picture"),
    }
}

const VOLUME: &str = "volume [row][column][depth][feature]";

/// What overflows in any layer of the encoder is still to be seen in its volume.
#[test]
fn in_the_encoder() {
    for name in [
        "encoder.conv1", "encoder.layer1", "encoder.layer2", "encoder.layer4", "decoder.aspp.0.convs",
        "decoder.aspp.1", "decoder.modified_up.stage2", "decoder.modified_up", "decoder.block2",
        "volume_head.up.stage1", "volume_head.up", "volume_head.reshape_conv",
    ] {
        println!("{name}");
        let field = with_module(&format!("pixel_nerf_net.encoder.{name}"), LARGE);
        let error = not_finite(&field, &sources(2));
        assert_eq!((error.stage.as_str(), error.tensor.as_str()), ("encoding source 0", VOLUME), "{name}");
    }
}

#[test]
fn in_the_network_at_points() {
    for layer in 0..3 {
        let error = not_finite(&with_module(&format!("pixel_nerf_net.mlp.layers.{layer}"), LARGE), &sources(2));
        assert_eq!(error.stage, "rendering the target's features", "{layer}");
        assert_eq!(error.tensor, "feature image");
    }
}

#[test]
fn in_the_denoiser() {
    for name in [
        "map_layer0", "map_layer1", "enc.64x64_conv", "enc.64x64_block0.conv0", "enc.32x32_aux_residual",
        "enc.16x16_block0.qkv", "dec.16x16_in0.norm2", "dec.32x32_up.skip", "dec.64x64_aux_norm", "dec.64x64_aux_conv",
    ] {
        let error = not_finite(&with_module(&format!("denoiser.model.{name}"), LARGE), &sources(2));
        let said = (error.stage.as_str(), error.tensor.as_str());
        assert_eq!(said, ("denoising at level 80", "denoised picture"), "{name}");
    }
}

#[test]
fn in_a_photograph() {
    for bad in [f32::NAN, f32::INFINITY] {
        let mut sources = sources(2);
        sources.images[1].texels[5][1] = bad;
        let field = with_module("denoiser.model.map_layer0", 1.0);
        let error = not_finite(&field, &sources);
        assert_eq!((error.stage.as_str(), error.index), ("encoding source 1", 5 * 3 + 1));
        assert_eq!(error.tensor, "image [row][column][3]");
    }
}
