//! The metrics, and the files of their networks' parameters.

use super::wrong::{not_built, wrong};
use anyhow::Context;
use clap::Args;
use std::path::{Path, PathBuf};
use viewfuse_device::Device;
use viewfuse_device::choice::AnyDevice;
use viewfuse_evaluate::metrics::convention::Convention;
use viewfuse_evaluate::metrics::dists::Dists;
use viewfuse_evaluate::metrics::features::Inception;
use viewfuse_evaluate::metrics::heads::{published_dists, published_lpips};
use viewfuse_evaluate::metrics::lpips::{Lpips, LpipsTrunk};
use viewfuse_evaluate::metrics::{Metrics, Scorer};
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};

/// Heading of these options.
const METRICS: &str = "Options of metrics";

/// Metrics besides PSNR and SSIM.
#[derive(Args)]
pub(crate) struct MetricOptions {
    /// Score with LPIPS: its network (alex, vgg or squeeze) and torchvision's state_dict of it; may be given once for
    /// each network. The published heads are built in
    #[arg(long, value_name = "NETWORK=FILE[,heads=FILE]", value_parser = parse_lpips, help_heading = METRICS)]
    lpips: Vec<(LpipsTrunk, NetworkFile)>,
    /// Score with DISTS: torchvision's state_dict of VGG16. The published weights are built in
    #[arg(long, value_name = "FILE[,heads=FILE]", value_parser = parse_file, help_heading = METRICS)]
    dists: Option<NetworkFile>,
    /// Score sets of pictures with FID and KID: the Inception of pytorch-fid (pt_inception-2015-12-05), or
    /// torchvision's
    #[arg(long, value_name = "FILE", help_heading = METRICS)]
    fid: Option<PathBuf>,
    /// Convention of the scores: plain, pixelnerf or viewattention, as in published evaluations
    #[arg(long, value_name = "CONVENTION", default_value_t, help_heading = METRICS)]
    metrics_as: Convention,
}

/// The file of a network's parameters, and optionally other heads than the published ones.
#[derive(Clone, Debug)]
struct NetworkFile {
    trunk: PathBuf,
    heads: Option<PathBuf>,
}

impl NetworkFile {
    /// The trunk and the heads.
    fn open(
        &self,
        published: impl FnOnce() -> Result<Checkpoint, CheckpointError>,
    ) -> Result<[Checkpoint; 2], CheckpointError> {
        let heads = self.heads.as_deref().map_or_else(published, Checkpoint::open)?;
        Ok([Checkpoint::open(&self.trunk)?, heads])
    }
}

impl MetricOptions {
    /// The files of all networks and heads.
    pub(crate) fn files(&self) -> Vec<&Path> {
        let networks = self.lpips.iter().map(|(_, files)| files).chain(&self.dists);
        let files = networks.flat_map(|files| [Some(&files.trunk), files.heads.as_ref()]).flatten();
        files.chain(&self.fid).map(PathBuf::as_path).collect()
    }

    /// Rejects `--fid` where pictures are scored one by one.
    pub(crate) fn refuse_sets(&self) -> anyhow::Result<()> {
        match self.fid {
            Some(_) => Err(wrong(
                "--fid compares sets of pictures, but this command scores each picture alone; see `viewfuse compare`",
            )),
            None => Ok(()),
        }
    }

    /// Loads the networks to one of the devices.
    pub(crate) fn on<'a>(&self, device: &'a AnyDevice) -> anyhow::Result<Box<dyn Scorer + 'a>> {
        Ok(match device {
            AnyDevice::Cpu(device) => Box::new(self.open(device)?),
            AnyDevice::Vulkan(device) => Box::new(self.open(device.as_ref())?),
        })
    }

    /// Loads the networks to a device.
    pub(crate) fn open<'a, D: Device>(&self, device: &'a D) -> anyhow::Result<Metrics<'a, D>> {
        if self.fid.is_some() && cfg!(not(feature = "fid")) {
            return Err(wrong(not_built("FID and KID", "fid")));
        }
        let mut lpips: Vec<Lpips<D>> = Vec::new();
        for (kind, files) in &self.lpips {
            if lpips.iter().any(|other| other.kind() == *kind) {
                return Err(wrong(format_args!("--lpips {kind}=... is given twice")));
            }
            let [trunk, heads] = files.open(|| published_lpips(*kind))?;
            lpips.push(Lpips::new(device, *kind, &trunk, &heads).with_context(|| format!("--lpips {kind}"))?);
        }
        let dists = |files: &NetworkFile| {
            let [trunk, weights] = files.open(published_dists)?;
            Dists::new(device, &trunk, &weights).context("--dists")
        };
        let inception = |path: &PathBuf| Inception::new(device, &Checkpoint::open(path)?).context("--fid");
        Ok(Metrics {
            device,
            convention: self.metrics_as,
            lpips,
            dists: self.dists.as_ref().map(dists).transpose()?,
            inception: self.fid.as_ref().map(inception).transpose()?,
        })
    }
}

fn parse_lpips(text: &str) -> Result<(LpipsTrunk, NetworkFile), String> {
    let Some((network, files)) = text.split_once('=') else {
        return Err("a network and its file, for example alex=alexnet.pth".to_owned());
    };
    let network = network.parse::<LpipsTrunk>().map_err(|error| error.to_string())?;
    Ok((network, parse_file(files)?))
}

fn parse_file(text: &str) -> Result<NetworkFile, String> {
    let (trunk, heads) = match text.split_once(",heads=") {
        Some((trunk, heads)) => (trunk, Some(heads)),
        None => (text, None),
    };
    if trunk.is_empty() || heads.is_some_and(str::is_empty) {
        return Err("a file, for example vgg16.pth, or two, vgg16.pth,heads=weights.pt".to_owned());
    }
    Ok(NetworkFile { trunk: trunk.into(), heads: heads.map(PathBuf::from) })
}
