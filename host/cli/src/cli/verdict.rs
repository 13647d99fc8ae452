//! What a score looks like, in words.

use viewfuse_field::auto::Pair;

/// Of a picture with this score, decibels.
pub(crate) fn in_words(psnr: f64) -> &'static str {
    match psnr {
        26.0.. => "good: sharp, small errors at edges",
        20.0.. => "soft: blurred or torn in places",
        _ => "broken: what is where cannot be relied on",
    }
}

/// Of pictures from between two photographs.
pub(crate) fn of_two(pair: &Pair) -> String {
    let Pair { degrees, has_silhouettes, measured } = pair;
    let [least, greatest] = measured.psnr;
    let shown = if *has_silhouettes { "two silhouettes" } else { "two photographs" };
    let verdict = in_words(0.5 * (least + greatest));
    format!(
        "{shown} {degrees:.0} degrees apart: pictures from between {} such pairs of other scenes had {least:.0} to \
         {greatest:.0} dB ({verdict}); with a third photograph it can be measured here",
        measured.pairs
    )
}
