//! What makes a saloon a saloon: proportions drawn around those of real cars.

use super::super::draws::Draws;

/// The upper part of a car.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Top {
    /// Screens, roof and pillars along straight lines.
    Straight,
    /// One arc, as of small cars of the fifties.
    Round,
    /// None: a cockpit.
    Open,
}

/// Proportions. Places along the car and heights are fractions as in [`super`].
pub(super) struct Style {
    /// Width and height as fractions of the length.
    pub(super) width: f32,
    pub(super) height: f32,
    /// Where the windscreen begins, where it meets the roof, where the roof ends, and where the rear screen ends.
    pub(super) cowl: f32,
    pub(super) screen: f32,
    pub(super) roof_end: f32,
    pub(super) deck: f32,
    /// Heights of the body: front end, foot of the windscreen, foot of the rear screen, rear end.
    pub(super) nose_top: f32,
    pub(super) cowl_top: f32,
    pub(super) deck_top: f32,
    pub(super) tail_top: f32,
    /// Height of the windows' lower edge.
    pub(super) belt: f32,
    /// Axles along the car.
    pub(super) rear_axle: f32,
    pub(super) front_axle: f32,
    /// Size of the wheels, 1 for a saloon's.
    pub(super) wheels: f32,
    /// How much the ends are pointed, seen from above; 1 for a saloon's.
    pub(super) pointed: f32,
    /// Windows on each side, and the share of the cabin behind them without any.
    pub(super) window_count: u32,
    pub(super) blind: f32,
    /// Kind of upper part.
    pub(super) top: Top,
    /// Whether the load stands in an open bed behind the cabin.
    pub(super) bed: bool,
    /// Whether it is made for racing: wings, intakes.
    pub(super) sporty: bool,
}

impl Style {
    /// Any of the kinds of cars.
    pub(super) fn draw(draws: &mut Draws) -> Style {
        let mut style = saloon(draws);
        match draws.below(20) {
            0..4 => {}
            4..7 => hatchback(&mut style, draws),
            7..9 => van(&mut style, draws),
            9..11 => pickup(&mut style, draws),
            11..16 => sports_car(&mut style, draws),
            16..18 => open_racer(&mut style, draws),
            _ => round(&mut style, draws),
        }
        style
    }
}

fn saloon(draws: &mut Draws) -> Style {
    let belt = draws.between(0.52, 0.62);
    let deck = draws.between(0.14, 0.24);
    let cowl = draws.between(0.64, 0.74);
    Style {
        width: draws.between(0.37, 0.45),
        height: draws.between(0.26, 0.33),
        cowl,
        screen: cowl - draws.between(0.1, 0.16),
        roof_end: deck + draws.between(0.08, 0.15),
        deck,
        nose_top: belt - draws.between(0.1, 0.22),
        cowl_top: belt,
        deck_top: belt + draws.between(-0.02, 0.06),
        tail_top: belt - draws.between(-0.02, 0.1),
        belt,
        rear_axle: draws.between(0.17, 0.23),
        front_axle: draws.between(0.77, 0.82),
        wheels: 1.0,
        pointed: 1.0,
        window_count: 2,
        blind: 0.0,
        top: Top::Straight,
        bed: false,
        sporty: draws.chance(0.25),
    }
}

fn hatchback(style: &mut Style, draws: &mut Draws) {
    style.width = draws.between(0.4, 0.5);
    style.height = draws.between(0.3, 0.42);
    style.deck = draws.between(0.01, 0.07);
    style.roof_end = style.deck + draws.between(0.03, 0.14);
    style.tail_top = style.belt - draws.between(0.0, 0.08);
    style.cowl = draws.between(0.68, 0.78);
    style.screen = style.cowl - draws.between(0.1, 0.2);
    style.window_count = draws.one_of([1, 2, 3]);
}

fn van(style: &mut Style, draws: &mut Draws) {
    style.height = draws.between(0.38, 0.5);
    style.width = draws.between(0.36, 0.44);
    style.belt = draws.between(0.45, 0.56);
    style.cowl = draws.between(0.78, 0.93);
    style.screen = style.cowl - draws.between(0.06, 0.14);
    style.deck = 0.015;
    style.roof_end = draws.between(0.02, 0.05);
    style.cowl_top = style.belt;
    style.nose_top = style.belt - draws.between(0.05, 0.15);
    style.deck_top = style.belt;
    style.tail_top = style.belt;
    style.wheels = draws.between(0.8, 0.95);
    style.pointed = 0.4;
    style.window_count = draws.one_of([1, 2, 3]);
    style.blind = if style.window_count == 1 { draws.between(0.55, 0.7) } else { 0.0 };
}

fn pickup(style: &mut Style, draws: &mut Draws) {
    style.height = draws.between(0.32, 0.38);
    style.width = draws.between(0.36, 0.42);
    style.belt = draws.between(0.55, 0.62);
    style.cowl = draws.between(0.66, 0.76);
    style.screen = style.cowl - draws.between(0.06, 0.12);
    style.deck = draws.between(0.36, 0.48);
    style.roof_end = style.deck + draws.between(0.01, 0.05);
    style.cowl_top = style.belt;
    style.nose_top = style.belt - draws.between(0.02, 0.12);
    style.deck_top = draws.between(0.34, 0.42);
    style.tail_top = style.deck_top;
    style.wheels = draws.between(1.0, 1.2);
    style.pointed = 0.5;
    style.window_count = draws.one_of([1, 2]);
    style.bed = true;
}

fn sports_car(style: &mut Style, draws: &mut Draws) {
    style.width = draws.between(0.4, 0.48);
    style.height = draws.between(0.21, 0.27);
    style.belt = draws.between(0.56, 0.66);
    style.cowl = draws.between(0.6, 0.74);
    style.screen = style.cowl - draws.between(0.12, 0.2);
    style.deck = draws.between(0.08, 0.26);
    style.roof_end = style.deck + draws.between(0.12, 0.22);
    style.cowl_top = style.belt;
    style.nose_top = style.belt - draws.between(0.16, 0.32);
    style.deck_top = style.belt + draws.between(0.0, 0.1);
    style.tail_top = style.deck_top - draws.between(0.0, 0.1);
    style.wheels = draws.between(1.0, 1.1);
    style.pointed = draws.between(0.9, 1.5);
    style.window_count = 1;
    style.sporty = true;
}

fn open_racer(style: &mut Style, draws: &mut Draws) {
    sports_car(style, draws);
    style.height = draws.between(0.17, 0.23);
    style.belt = draws.between(0.66, 0.76);
    style.nose_top = style.belt - draws.between(0.25, 0.4);
    style.cowl_top = style.belt;
    style.deck_top = style.belt + draws.between(0.0, 0.1);
    style.tail_top = style.deck_top - draws.between(0.0, 0.15);
    style.top = Top::Open;
}

fn round(style: &mut Style, draws: &mut Draws) {
    style.width = draws.between(0.36, 0.44);
    style.height = draws.between(0.3, 0.38);
    style.belt = draws.between(0.46, 0.54);
    style.deck = draws.between(0.03, 0.12);
    style.cowl = draws.between(0.66, 0.74);
    style.screen = style.cowl - 0.12;
    style.roof_end = style.deck + 0.18;
    style.nose_top = style.belt - draws.between(0.15, 0.25);
    style.cowl_top = style.belt;
    style.deck_top = style.belt;
    style.tail_top = style.belt - draws.between(0.1, 0.2);
    style.pointed = draws.between(1.0, 1.6);
    style.top = Top::Round;
}
