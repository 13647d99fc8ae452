//! The reference values of the small member, damaged; as they are, a command of the main README compares them.

use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use std::collections::HashMap;
use std::path::PathBuf;
use viewfuse::check::verify::verify;
use viewfuse::device::cpu::Cpu;
use viewfuse::job::progress::Silent;

/// A tensor: its type, its shape, its bytes.
type Tensor = (Dtype, Vec<usize>, Vec<u8>);

fn file() -> PathBuf {
    viewfuse_tests::places::data("genvs_small.safetensors")
}

/// The file with a change, and what is said about it.
fn said_of(member: Option<&str>, change: impl FnOnce(&mut HashMap<String, Tensor>)) -> Result<Vec<String>, String> {
    let bytes = std::fs::read(file()).expect("the file");
    let given = SafeTensors::deserialize(&bytes).expect("tensors");
    let named =
        |(name, view): (String, TensorView<'_>)| (name, (view.dtype(), view.shape().to_vec(), view.data().to_vec()));
    let mut tensors: HashMap<String, Tensor> = given.tensors().into_iter().map(named).collect();
    change(&mut tensors);
    let views = tensors.iter().map(|(name, (dtype, shape, data))| {
        (name.clone(), TensorView::new(*dtype, shape.clone(), data).expect("a tensor"))
    });
    let metadata = member.map(|member| HashMap::from([("member".to_owned(), member.to_owned())]));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("changed.safetensors");
    let written = safetensors::serialize(views, metadata).expect("bytes");
    std::fs::write(&path, written).expect("a file");
    let report = verify(&path, &Cpu, &Silent).map_err(|error| error.to_string())?;
    let failing = report.quantities.iter().filter(|quantity| !quantity.passes());
    Ok(failing.map(|quantity| quantity.name.clone()).collect())
}

fn numbers<'a>(tensors: &'a mut HashMap<String, Tensor>, name: &str) -> &'a mut Vec<u8> {
    &mut tensors.get_mut(name).expect("a tensor").2
}

#[track_caller]
fn assert_refused(member: Option<&str>, part: &str, change: impl FnOnce(&mut HashMap<String, Tensor>)) {
    let message = said_of(member, change).expect_err("must be refused");
    assert!(message.contains("changed.safetensors") && message.contains(part), "no {part:?} in: {message}");
}

#[test]
fn one_number_that_is_another_is_noticed() {
    for (name, quantity) in [
        ("volume_value", "GeNVS volumes"),
        ("mlp_out", "GeNVS densities and features"),
        ("feature_image_value.baseline_mean", "GeNVS feature image, mean"),
        ("feature_image_value.error_weighing_alpha=1.0", "GeNVS feature image, error:alpha=1,angle=full"),
        ("denoise_value.0.5", "GeNVS denoised at level 0.5"),
    ] {
        for bad in [0.01, f32::NAN] {
            let failing = said_of(Some("small"), |tensors| {
                let bytes = &mut numbers(tensors, name)[40..44];
                let value = f32::from_le_bytes(bytes.try_into().expect("four bytes")) + bad;
                bytes.copy_from_slice(&value.to_le_bytes());
            });
            assert_eq!(failing, Ok(vec![quantity.to_owned()]));
        }
    }
}

#[test]
fn another_member_is_refused() {
    assert_refused(Some("tiny"), "'member' is 'tiny'; there is 'small'", |_| {});
    assert_refused(None, "images: are not 128x128", |_| {});
}

#[test]
fn what_is_missing_or_misshapen_is_named() {
    let small = Some("small");
    for name in [
        "images", "src_poses", "tgt_pose", "focal_normalized", "latents", "mlp_in", "mlp_out", "volume_index",
        "feature_image_index", "denoise_index", "feature_image_full.error_alpha1_half",
    ] {
        assert_refused(small, name, |tensors| drop(tensors.remove(name)));
    }
    assert_refused(small, "denoise_sigma: 5 has no denoise_value", |tensors| drop(tensors.remove("denoise_value.5")));
    let short = |tensors: &mut HashMap<String, Tensor>, name: &str| {
        let (dtype, shape, data) = tensors.get_mut(name).expect("a tensor");
        let count = shape.iter().product::<usize>() / 2;
        data.truncate(count * dtype.bitsize() / 8);
        *shape = vec![count];
    };
    for name in [
        "latents", "volume_value", "mlp_out", "denoise_value.0.05", "sample_4_steps",
        "feature_image_full.error_alpha1_half",
    ] {
        assert_refused(small, name, |tensors| short(tensors, name));
    }
    let large = |tensors: &mut HashMap<String, Tensor>, name: &str| {
        numbers(tensors, name)[..8].copy_from_slice(&(1_i64 << 40).to_le_bytes());
    };
    for name in ["volume_index", "feature_image_index", "denoise_index"] {
        assert_refused(small, "holds an index that is too large", |tensors| large(tensors, name));
    }
}
