//! The picture of which photographs match which.

use viewfuse::output::canvas::{BLUE, GREY, INK, PAPER, RED};
use viewfuse::output::match_graph::{MARGIN, SIDE, match_graph};

#[test]
fn ties_and_poses_have_their_colours() {
    let names: Vec<String> = (0..4).map(|number| format!("{number}")).collect();
    let pairs = [(0, 2, 120), (1, 3, 20)];
    let picture = match_graph(&names, &pairs, 50, &[true, false, true, true]);
    let pixel = |x: i32, y: i32| picture.get_pixel(x as u32, y as u32).0;
    let (middle, radius) = (SIDE / 2, SIDE / 2 - MARGIN);
    // The first is on top, and the others go around as a clock does.
    assert_eq!(pixel(middle, middle - radius), BLUE);
    assert_eq!(pixel(middle + radius, middle), RED);
    assert_eq!((pixel(middle, middle + radius / 2), pixel(middle + radius / 2, middle)), (INK, GREY));
    assert_eq!(pixel(middle - 1, middle + radius / 2), INK, "two pixels thick");
    assert_eq!(pixel(middle + radius / 2, middle + 1), PAPER);
}
