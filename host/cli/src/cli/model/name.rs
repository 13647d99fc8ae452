//! The values of `--model`.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use viewfuse_field::family::{Family, Small, TestNetwork};
use viewfuse_nn::checkpoint::Checkpoint;

/// Help of `--model`: the families with their test networks.
pub(crate) fn model_help() -> String {
    let families = Family::ALL.map(|family| format!("a {family}")).join(" or ");
    let sizes = |network: &TestNetwork| match network.small {
        Small::Width => format!("{}[:WIDTH]", network.name),
        Small::One => format!("{}[:small]", network.name),
    };
    let tests = Family::ALL.map(|family| {
        format!("{} ({family})", family.test_networks().iter().map(sizes).collect::<Vec<_>>().join(", "))
    });
    format!(
        "Checkpoint of {families} (.pth, .pt, .safetensors, .pkl), or a test network with deterministic initialisation: \
         {} [default: the training-free field]",
        tests.join(", ")
    )
}

/// The source of a network's parameters.
#[derive(Clone)]
pub(crate) enum Model {
    /// A checkpoint.
    File(PathBuf),
    /// A test network: the published size, or a small member of its family.
    Test(&'static TestNetwork, Option<u16>),
}

impl FromStr for Model {
    type Err = String;

    fn from_str(text: &str) -> Result<Model, String> {
        let (name, size) = match text.split_once(':') {
            Some((name, size)) => (name, Some(size)),
            None => (text, None),
        };
        let mut networks = Family::ALL.into_iter().flat_map(Family::test_networks);
        let Some(network) = networks.find(|network| network.name == name) else {
            return Ok(Model::File(PathBuf::from(text)));
        };
        let size = match (network.small, size) {
            (_, None) => None,
            (Small::One, Some("small")) => Some(0),
            (Small::One, Some(_)) => {
                return Err(format!("'{text}': the sizes are {name}, the published one, and {name}:small"));
            }
            (Small::Width, Some(width)) => match width.parse::<u16>() {
                Ok(width) if (8..=2048).contains(&width) && width % 8 == 0 => Some(width),
                _ => return Err(format!("'{text}': a width is a multiple of 8 from 8 to 2048")),
            },
        };
        Ok(Model::Test(network, size))
    }
}

impl fmt::Display for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Model::File(path) => write!(f, "{}", path.display()),
            Model::Test(network, None) => f.write_str(network.name),
            Model::Test(TestNetwork { name, small: Small::One, .. }, Some(_)) => write!(f, "{name}:small"),
            Model::Test(TestNetwork { name, small: Small::Width, .. }, Some(width)) => write!(f, "{name}:{width}"),
        }
    }
}

impl Model {
    /// The parameters.
    pub(crate) fn checkpoint(&self) -> anyhow::Result<Checkpoint> {
        Ok(match self {
            Model::File(path) => Checkpoint::open(path)?,
            Model::Test(network, size) => (network.checkpoint)(*size),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Model;

    #[test]
    fn the_help_names_every_test_network() {
        assert_eq!(
            super::model_help(),
            "Checkpoint of a PixelNeRF or a GeNVS (.pth, .pt, .safetensors, .pkl), or a test network with deterministic \
             initialisation: formula[:WIDTH], body[:WIDTH] (PixelNeRF), genvs[:small] (GeNVS) [default: the training-free \
             field]"
        );
    }

    #[test]
    fn models_by_name() {
        for text in ["formula", "formula:64", "body", "body:16", "genvs", "genvs:small", "network-snapshot-005000.pkl"]
        {
            let model: Model = text.parse().expect(text);
            assert_eq!(model.to_string(), text);
            assert_eq!(matches!(model, Model::File(_)), text.ends_with(".pkl"));
        }
        for text in ["formula:7", "body:", "genvs:", "genvs:64", "genvs:Small"] {
            let message = text.parse::<Model>().err().expect(text);
            assert!(message.starts_with(&format!("'{text}': ")), "{message}");
        }
    }
}
