//! Pictures that are rendered smaller, enlarged.

use super::Rendered;

/// A picture of `[width, height]` pixels, each the bilinear mean of the four nearest ones of a smaller picture; depths
/// and confidences are those of the nearest one, since the mean of two depths is not on a surface.
pub(crate) fn enlarged(rendered: Rendered, [width, height]: [u32; 2]) -> Rendered {
    if [rendered.width, rendered.height] == [width, height] {
        return rendered;
    }
    let (columns, rows) = (places(rendered.width, width), places(rendered.height, height));
    let at = |row: u32, column: u32| (row * rendered.width + column) as usize;
    let mut picture = Rendered { colours: Vec::new(), depths: Vec::new(), confidences: Vec::new(), width, height };
    for [top, bottom] in &rows {
        for [left, right] in &columns {
            let mut colour = [0.0; 4];
            for (row, row_share) in [top, bottom] {
                for (column, column_share) in [left, right] {
                    let texel = rendered.colours[at(*row, *column)];
                    colour = [0, 1, 2, 3].map(|channel| colour[channel] + row_share * column_share * texel[channel]);
                }
            }
            picture.colours.push(colour);
            let nearest = |[first, second]: [&(u32, f32); 2]| if first.1 >= second.1 { first.0 } else { second.0 };
            let index = at(nearest([top, bottom]), nearest([left, right]));
            picture.depths.extend(rendered.depths.get(index));
            picture.confidences.extend(rendered.confidences.get(index));
        }
    }
    picture
}

/// For each of `enlarged` pixels along an axis the two nearest of `count`, with their shares, which sum to 1.
fn places(count: u32, enlarged: u32) -> Vec<[(u32, f32); 2]> {
    let last = count.saturating_sub(1);
    let place = |pixel: u32| {
        let centre = (pixel as f32 + 0.5) * count as f32 / enlarged as f32 - 0.5;
        let centre = centre.clamp(0.0, last as f32);
        let (before, share) = (centre.floor(), centre.fract());
        [(before as u32, 1.0 - share), ((before as u32 + 1).min(last), share)]
    };
    (0..enlarged).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_stays_a_slope() {
        let colours = (0..8).map(|index| [(index % 4) as f32, (index / 4) as f32, 0.5, 1.0]).collect();
        let depths: Vec<f32> = (0..8).map(|index| index as f32).collect();
        let picture = enlarged(Rendered { colours, confidences: depths.clone(), depths, width: 4, height: 2 }, [8, 4]);
        let red: Vec<f32> = picture.colours[..8].iter().map(|colour| colour[0]).collect();
        assert_eq!(red, [0.0, 0.25, 0.75, 1.25, 1.75, 2.25, 2.75, 3.0]);
        let green: Vec<f32> = picture.colours.iter().step_by(8).map(|colour| colour[1]).collect();
        assert_eq!(green, [0.0, 0.25, 0.75, 1.0]);
        assert!(picture.colours.iter().all(|colour| colour[2..] == [0.5, 1.0]));
        assert_eq!(picture.depths[..8], [0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0]);
        assert_eq!(picture.confidences, picture.depths);
        assert_eq!((picture.width, picture.height, picture.depths.len()), (8, 4, 32));
    }

    #[test]
    fn odd_sides_and_no_depths() {
        let picture = enlarged(
            Rendered { colours: vec![[0.5; 4]; 6], depths: Vec::new(), confidences: Vec::new(), width: 3, height: 2 },
            [5, 3],
        );
        assert_eq!((picture.colours.len(), picture.depths.len()), (15, 0));
        assert!(picture.colours.iter().flatten().all(|value| (value - 0.5).abs() < 1.0e-6));
    }
}
