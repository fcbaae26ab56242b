//! The memory of a rate-independent hysteresis: the turning points that have not been wiped out.

/// What a Preisach operator does on its branches, integrated from its density (Everett functions).
pub(crate) trait Branches {
    /// An input with whatever the density can work out from it alone.
    type Point: Copy + std::fmt::Debug + Default;
    /// Works that out.
    fn point(&self, input_v: f64) -> Self::Point;
    /// Rise of the output when the input goes from the turning point `low` monotonically up to `high`
    /// (equally the fall from `high` down to `low`).
    fn between(&self, low: &Self::Point, high: &Self::Point) -> f64;
    /// Output on the virgin curve, all operators at rest at 0 V before.
    fn virgin(&self, input: &Self::Point) -> f64;
}

#[derive(Debug, Clone, Copy)]
struct Turn<P> {
    input_v: f64,
    point: P,
    output: f64,
}

/// The stack of turning points. Return-point memory and wiping-out hold by construction.
///
/// `y = y_k + E(v, v_k)` on the way up from the last turning point k, `y = y_k - E(v_k, v)` on the way down; when the input passes
/// the turning point before, both are wiped out and the outer branch goes on; beyond the largest input ever the virgin curve does.
///
/// # Cost
/// One Everett evaluation an input; the stack is as deep as the nesting of the minor loops.
///
/// # Reference
/// Mayergoyz, *Mathematical Models of Hysteresis* (1991), chapter 1: reduced memory sequences.
#[derive(Debug, Clone, Default)]
pub(crate) struct Memory<P> {
    turns: Vec<Turn<P>>,
    input_v: f64,
    point: P,
    output: f64,
}

impl<P: Copy + std::fmt::Debug + Default> Memory<P> {
    /// Moves the input and gives the output.
    #[inline]
    pub(crate) fn advance(&mut self, branches: &impl Branches<Point = P>, input_v: f64) -> f64 {
        if input_v == self.input_v {
            return self.output;
        }
        let rising = input_v > self.input_v;
        let branch_rises = match self.turns.last() {
            Some(turn) => self.input_v > turn.input_v,
            None => self.input_v > 0.0,
        };
        let at_start = self.turns.is_empty() && self.input_v == 0.0;
        if rising != branch_rises && !at_start {
            self.turns.push(Turn {
                input_v: self.input_v,
                point: self.point,
                output: self.output,
            });
        }
        self.wipe_out(input_v, rising);
        self.point = branches.point(input_v);
        self.output = match self.turns.last() {
            None => branches.virgin(&self.point),
            Some(turn) if rising => turn.output + branches.between(&turn.point, &self.point),
            Some(turn) => turn.output - branches.between(&self.point, &turn.point),
        };
        self.input_v = input_v;
        self.output
    }

    #[inline]
    fn wipe_out(&mut self, input_v: f64, rising: bool) {
        loop {
            match self.turns.as_slice() {
                [] => return,
                [only] => {
                    if input_v.abs() >= only.input_v.abs() {
                        self.turns.clear();
                    }
                    return;
                }
                [.., before, _] => {
                    let passed = if rising {
                        input_v >= before.input_v
                    } else {
                        input_v <= before.input_v
                    };
                    if !passed {
                        return;
                    }
                    let kept = self.turns.len() - 2;
                    self.turns.truncate(kept);
                }
            }
        }
    }
}
