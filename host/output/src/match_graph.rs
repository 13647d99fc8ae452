//! Which photographs match which, as a picture: photographs on a circle, a line for each pair that matches.

use super::canvas::{BLUE, CHARACTER_WIDTH, Canvas, GREY, INK, LINE_HEIGHT, PAPER, RED};
use image::RgbImage;
use std::f64::consts::{PI, TAU};

/// The side of the square in which the circle is.
pub const SIDE: i32 = 640;
/// From the square to the circle.
pub const MARGIN: i32 = 90;
/// Counts are written where no more photographs than these cross one another's lines.
const MAX_COUNTED: usize = 12;
/// Matches from which on a line is thicker by a pixel.
const THICKER: [usize; 3] = [100, 300, 1000];
/// Most characters of a name.
const MAX_CHARACTERS: usize = 14;

/// The photographs of these names, blue with a pose and red without, in their order around a circle; pairs, each with
/// its number of matches, as lines: grey below `min_tie`, which may be by chance.
pub fn match_graph(names: &[String], pairs: &[(usize, usize, usize)], min_tie: usize, has_pose: &[bool]) -> RgbImage {
    let legend = [
        format!(
            "lines: matches of two photographs, thicker from {}, {} and {} on;",
            THICKER[0], THICKER[1], THICKER[2]
        ),
        format!("grey: fewer than {min_tie}, which may be by chance; blue: with a pose, red: without"),
    ];
    let mut canvas = Canvas::new(SIDE as u32, SIDE as u32 + legend.len() as u32 * LINE_HEIGHT + 12);
    let radius = f64::from(SIDE / 2 - MARGIN);
    let direction = |place: usize| (TAU * place as f64 / names.len().max(1) as f64 - PI / 2.0).sin_cos();
    let at = |place: usize, radius: f64| {
        let (sin, cos) = direction(place);
        (SIDE / 2 + (radius * cos) as i32, SIDE / 2 + (radius * sin) as i32)
    };
    let mut sorted = pairs.to_vec();
    sorted.sort_by_key(|(.., count)| *count);
    for &(a, b, count) in &sorted {
        let colour = if count < min_tie { GREY } else { INK };
        let width = 1 + THICKER.iter().filter(|from| count >= **from).count() as i32;
        let (from, to) = (at(a, radius), at(b, radius));
        // Aside of a line that is more level, below it; of one that is steeper, to its right.
        let is_level = (to.0 - from.0).abs() > (to.1 - from.1).abs();
        for offset in -(width / 2)..width - width / 2 {
            let moved = |(x, y): (i32, i32)| if is_level { (x, y + offset) } else { (x + offset, y) };
            canvas.line(moved(from), moved(to), colour);
        }
    }
    if names.len() <= MAX_COUNTED {
        for &(a, b, count) in sorted.iter().filter(|(.., count)| *count >= min_tie) {
            // A third along: in the middle, lines of a circle meet.
            let (from, to) = (at(a, radius), at(b, radius));
            let text = count.to_string();
            let width = text.len() as u32 * CHARACTER_WIDTH;
            let place = [(2 * from.0 + to.0) / 3 - width as i32 / 2, (2 * from.1 + to.1) / 3 - LINE_HEIGHT as i32 / 2];
            canvas.fill(place[0] - 1, place[1], width + 2, LINE_HEIGHT - 1, PAPER);
            canvas.text(place[0], place[1], &text, INK);
        }
    }
    for (place, name) in names.iter().enumerate() {
        canvas.disc(at(place, radius), 11, if has_pose.get(place) == Some(&true) { BLUE } else { RED });
        // The end of a long name tells more than its beginning.
        let skipped = name.chars().count().saturating_sub(MAX_CHARACTERS);
        let label: String = name.chars().skip(skipped).collect();
        let (x, y) = at(place, radius + 14.0);
        let width = (label.chars().count() as u32 * CHARACTER_WIDTH) as i32;
        let x = if x >= SIDE / 2 { x } else { x - width };
        canvas.text(x, y - LINE_HEIGHT as i32 / 2, &label, INK);
    }
    for (line, text) in (0..).zip(&legend) {
        canvas.text(10, SIDE + 4 + line * LINE_HEIGHT as i32, text, INK);
    }
    canvas.into_image()
}
