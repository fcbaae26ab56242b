//! The references that a board has, by their names.

use crate::Shape;

/// A reference with its name in commands and on pages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Named {
    /// What a period looks like.
    pub shape: Shape,
    /// Its name.
    pub name: &'static str,
    /// What it is, in words.
    pub about: &'static str,
}

/// All of them.
pub const SHAPES: [Named; 6] = [
    Named {
        shape: Shape::Sine,
        name: "sine",
        about: "From the lowest point on",
    },
    Named {
        shape: Shape::ComplexHarmonic,
        name: "complex-harmonic",
        about: "The paper's sum of a sine and its third harmonic",
    },
    Named {
        shape: Shape::Triangle,
        name: "triangle",
        about: "Straight lines",
    },
    Named {
        shape: Shape::Steps,
        name: "steps",
        about: "A staircase of quarters",
    },
    Named {
        shape: Shape::Spiral,
        name: "spiral",
        about: "Twenty turns outwards and as many back, the cosine",
    },
    Named {
        shape: Shape::SpiralSine,
        name: "spiral-sine",
        about: "The same with the sine, for the other axis",
    },
];

impl Named {
    /// The reference of a name.
    pub fn find(name: &str) -> Option<Self> {
        SHAPES.into_iter().find(|known| known.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_each_is_found_by_its_name_and_stands_once() {
        for (k, named) in SHAPES.into_iter().enumerate() {
            assert_eq!(Named::find(named.name), Some(named));
            assert!(SHAPES[..k].iter().all(|other| other.shape != named.shape));
        }
        assert_eq!(Named::find("moon"), None);
    }
}
