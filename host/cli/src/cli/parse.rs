//! Values of options that several commands have.

use std::time::Duration;

/// Width and height of pictures.
pub(super) fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    match sides {
        Some([width, height]) if (1..=16_384).contains(&width) && (1..=16_384).contains(&height) => Ok([width, height]),
        _ => Err("a size is WIDTHxHEIGHT, for example 160x120, each from 1 to 16384".to_owned()),
    }
}

/// A share of something.
pub(super) fn parse_share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(share) if (0.0..1.0).contains(&share) => Ok(share),
        _ => Err("a share is a number of at least 0 and less than 1".to_owned()),
    }
}

/// A time.
pub(super) fn parse_seconds(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.001..=86_400.0).contains(&seconds) => Ok(Duration::from_secs_f64(seconds)),
        _ => Err("a number of seconds from 0.001 to 86400".to_owned()),
    }
}

/// How many.
pub(super) fn parse_count(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(count) if (1..=10_000).contains(&count) => Ok(count),
        _ => Err("a whole number from 1 to 10000".to_owned()),
    }
}
