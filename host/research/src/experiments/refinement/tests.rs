use super::*;
use candle_core::{Device, Tensor};
use learning::{Learning, train};
use network::{Network, Parts};
use viewfuse_core::random::normal;

const BOTH: Parts =
    Parts { temperature: false, blend: true, planes: true, directions: true, position: true, pooled_weights: true };

/// A small garden's picture from three sources.
fn some(seed: &str) -> anyhow::Result<Candidates> {
    let scratch = std::env::temp_dir().join(format!("viewfuse-refinement-test-{seed}-{}", std::process::id()));
    let scene = scenes::test_scene(&scratch.join("scene"), &format!("garden/arc/{seed}"), 32)?;
    let mut pictures = pictures(seed, scene, &"nearest:3:4".parse()?, 32)?;
    std::fs::remove_dir_all(&scratch)?;
    Ok(pictures.remove(0))
}

/// Changes all parameters.
fn disturb(network: &Network) -> candle_core::Result<()> {
    for (index, variable) in network.variables.iter().enumerate() {
        let noise = (0..variable.elem_count()).map(|place| 0.3 * normal([1, index as u32], place as u32, 0));
        let noise = Tensor::from_vec(noise.collect(), variable.shape(), &Device::Cpu)?;
        variable.set(&(variable.as_tensor() + noise)?)?;
    }
    Ok(())
}

/// Untrained, every variant is the field to rounding ([`Candidates::of`] compares its own sums with the field's picture), and
/// changed parameters change the picture.
#[test]
fn untrained_it_is_the_field() -> anyhow::Result<()> {
    let picture = some("7")?;
    let gain = |network: &Network| picture.gain(&network.refine(&picture.pixels)?.colours);
    for variant in &VARIANTS {
        let network = Network::new(variant.parts, 3)?;
        let own = gain(&network)?;
        assert!(own.abs() < 1.0e-4, "{}: {own}", variant.name);
        disturb(&network)?;
        let own = gain(&network)?;
        assert!(own.abs() > 1.0e-3, "{}: {own}", variant.name);
    }
    Ok(())
}

/// On the picture that it is trained on it becomes better than the field.
#[test]
fn it_learns() -> anyhow::Result<()> {
    let picture = some("8")?;
    let network = train(BOTH, &Learning { caution: 0.0, steps: 60, seed: 0 }, &[&picture])?;
    let gain = picture.gain(&network.refine(&picture.pixels)?.colours)?;
    assert!(gain > 0.1, "{gain}");
    Ok(())
}

/// The order of the sources does not matter.
#[test]
fn sources_have_no_order() -> anyhow::Result<()> {
    let picture = some("9")?;
    let network = Network::new(BOTH, 5)?;
    disturb(&network)?;
    let own = &picture.pixels;
    let order = Tensor::new(&[2_u32, 0, 1], &Device::Cpu)?;
    let other = candidates::Pixels {
        source: own.source.index_select(&order, 2)?,
        colour: own.colour.index_select(&order, 2)?,
        part: own.part.index_select(&order, 2)?,
        ..own.clone()
    };
    let (a, b) = (network.refine(own)?.colours, network.refine(&other)?.colours);
    let most = (a - b)?.abs()?.max_all()?.to_scalar::<f32>()?;
    assert!(most < 1.0e-4, "{most}");
    Ok(())
}
