//! Hysteresis of families that no model and no other simulated stage of the project has, as displacement from 0 to 1 over a voltage
//! from -1 to 1.

use rand::RngExt;
use rand_pcg::Pcg64;

/// A family of hysteresis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Family {
    /// Coleman and Hodgdon (1986): the slope follows the distance to a curve.
    ColemanHodgdon,
    /// Dahl (1968): a stiffness that falls as friction nears its limit, taken off the displacement.
    Dahl,
    /// Ramberg and Osgood (1943) with Masing's rule: branches that begin straight and bend by a power.
    RambergOsgood,
    /// Plays of two different nonlinear envelopes.
    GeneralisedPlay,
    /// Duhem's operator, linear in two states, with other rates up than down.
    SemilinearDuhem,
    /// Preisach plane by its Everett function; the density leans with the bias.
    SkewedEverett,
    /// Bouc and Wen (1976): minor loops do not close.
    BoucWen,
}

impl Family {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::ColemanHodgdon,
        Self::Dahl,
        Self::RambergOsgood,
        Self::GeneralisedPlay,
        Self::SemilinearDuhem,
        Self::SkewedEverett,
        Self::BoucWen,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::ColemanHodgdon => "coleman-hodgdon",
            Self::Dahl => "dahl",
            Self::RambergOsgood => "ramberg-osgood",
            Self::GeneralisedPlay => "generalised-play",
            Self::SemilinearDuhem => "semilinear-duhem",
            Self::SkewedEverett => "skewed-everett",
            Self::BoucWen => "bouc-wen",
        }
    }
}

/// Parameters of one stage's loops, all but their strength.
#[derive(Debug, Clone)]
enum Body {
    /// `dp = alpha |du| (f(u) - p) + (1 - strength) du`, `f(u) = u + bend u^3`.
    ColemanHodgdon { alpha: f64, bend: f64 },
    /// `dz = sigma du (1 - z sgn du)^power`, displacement `u - strength z`.
    Dahl { sigma: f64, power: f64 },
    /// Branch `2 f(d / 2)`, `f(x) = (1 - strength) x + strength x^power`.
    RambergOsgood { power: f64 },
    /// Plays of `scale tanh(slope u + shift)`, up and down.
    GeneralisedPlay {
        up: [f64; 2],
        down: [f64; 2],
        plays: Vec<[f64; 2]>,
    },
    /// `dx = rate |du| (u - x) + (1 - strength) du`, the rate up and down, the state's share.
    SemilinearDuhem { states: [[f64; 3]; 2] },
    /// `E(a, b) = F(a) - F(b) + strength d^2 / (1 + soft d) (1 + lean m)`, d = a - b, m = (a + b) / 2.
    SkewedEverett { lean: f64, soft: f64, curve: [f64; 2] },
    /// `dz = sigma du (1 - |z|^power (gamma + beta sgn(z du)))`, displacement `u - strength z`.
    BoucWen { sigma: f64, power: f64, beta: f64 },
}

/// Loops with their memory.
#[derive(Debug, Clone)]
pub struct Loops {
    body: Body,
    strength: f64,
    /// What is taken off, and the factor, so that the full loop goes from 0 to 1.
    norm: [f64; 2],
    last: f64,
    states: Vec<f64>,
    /// Turning points with the displacement there; the first is far below the range.
    turns: Vec<[f64; 2]>,
}

/// The voltage at which the memory of turning points begins; never reached again.
const BELOW_ALL: f64 = -1.6;

/// Longest step of the integration, of a range of 2.
const STEP: f64 = 0.01;

/// Steps of a branch on which a loop is measured.
const BRANCH: usize = 200;

impl Loops {
    /// Loops of a family with this opening, largest distance of the branches over the full displacement.
    pub fn draw(family: Family, opening: f64, rng: &mut Pcg64) -> Self {
        let (body, strongest) = draw_body(family, rng);
        let with = |strength: f64| {
            let mut loops = Self {
                body: body.clone(),
                strength,
                norm: [0.0, 1.0],
                last: 0.0,
                states: Vec::new(),
                turns: Vec::new(),
            };
            loops.clear();
            loops
        };
        let (mut weak, mut strong) = (0.0, strongest);
        for _ in 0..40 {
            let middle = 0.5 * (weak + strong);
            if with(middle).full_loop().opening < opening {
                weak = middle;
            } else {
                strong = middle;
            }
        }
        let mut loops = with(weak);
        let found = loops.full_loop();
        loops.norm = [found.low, 1.0 / (found.high - found.low)];
        loops.condition();
        loops
    }

    /// Loops as they are after full cycles, at the low end.
    pub fn condition(&mut self) {
        self.clear();
        for turn in [1.0, -1.0, 1.0, -1.0] {
            self.go(turn);
        }
    }

    /// Goes straight to a voltage; the displacement there.
    pub fn go(&mut self, to: f64) -> f64 {
        let from = self.last;
        let n = ((to - from).abs() / STEP).ceil().max(1.0) as usize;
        (1..=n).fold(0.0, |_, k| self.step(from + (to - from) * k as f64 / n as f64))
    }

    /// The displacement at the next voltage, reached straight from the last.
    pub fn step(&mut self, u: f64) -> f64 {
        let from = self.last;
        let raw = match &self.body {
            Body::RambergOsgood { .. } | Body::SkewedEverett { .. } => self.by_turns(u),
            Body::GeneralisedPlay { .. } => self.by_plays(u),
            _ => {
                let n = ((u - from).abs() / STEP).ceil().max(1.0) as usize;
                let du = (u - from) / n as f64;
                for k in 0..n {
                    self.integrate(from + du * k as f64, du);
                }
                self.displacement(u)
            }
        };
        self.last = u;
        (raw - self.norm[0]) * self.norm[1]
    }

    /// Slope just after a reversal in the middle of the range: what of the displacement follows at once.
    pub fn reversible_slope(&self) -> f64 {
        let mut probe = self.clone();
        probe.go(0.0);
        let at = probe.step(0.0);
        (at - probe.step(-0.02)) / 0.02
    }

    /// Largest distance of the branches over the full displacement.
    pub fn opening(&self) -> f64 {
        let mut probe = self.clone();
        probe.full_loop().opening
    }

    /// Smallest slope of the full loop's branches.
    pub fn least_slope(&self) -> f64 {
        let mut probe = self.clone();
        probe.full_loop().least_slope
    }

    fn clear(&mut self) {
        self.last = BELOW_ALL;
        self.turns = vec![[BELOW_ALL, 0.0]];
        self.states = match &self.body {
            Body::GeneralisedPlay { plays, .. } => vec![BELOW_ALL; plays.len()],
            Body::SemilinearDuhem { .. } => vec![BELOW_ALL; 2],
            Body::ColemanHodgdon { .. } => vec![BELOW_ALL],
            _ => vec![0.0],
        };
    }

    fn full_loop(&mut self) -> FullLoop {
        self.norm = [0.0, 1.0];
        self.condition();
        let u = |k: usize| -1.0 + 2.0 * k as f64 / BRANCH as f64;
        let up: Vec<f64> = (0..=BRANCH).map(|k| self.step(u(k))).collect();
        let mut down: Vec<f64> = (0..=BRANCH).rev().map(|k| self.step(u(k))).collect();
        down.reverse();
        let (low, high) = (up[0], up[BRANCH]);
        let distance = up.iter().zip(&down).map(|(up, down)| (down - up).abs());
        let slopes = up
            .windows(2)
            .chain(down.windows(2))
            .map(|w| (w[1] - w[0]) * BRANCH as f64 / 2.0);
        FullLoop {
            low,
            high,
            opening: distance.fold(0.0, f64::max) / (high - low),
            least_slope: slopes.fold(f64::INFINITY, f64::min) / (high - low),
        }
    }

    fn integrate(&mut self, u: f64, du: f64) {
        // Heun's rule.
        let first = self.slopes(u, du, &self.states);
        let there: Vec<f64> = self.states.iter().zip(&first).map(|(x, d)| x + d).collect();
        let second = self.slopes(u + du, du, &there);
        for (x, (a, b)) in self.states.iter_mut().zip(first.iter().zip(&second)) {
            *x += 0.5 * (a + b);
        }
    }

    fn slopes(&self, u: f64, du: f64, x: &[f64]) -> Vec<f64> {
        let at_once = 1.0 - self.strength;
        match &self.body {
            Body::ColemanHodgdon { alpha, bend } => {
                vec![alpha * du.abs() * (u + bend * u.powi(3) - x[0]) + at_once * du]
            }
            Body::Dahl { sigma, power } => vec![sigma * du * (1.0 - x[0] * du.signum()).max(0.0).powf(*power)],
            Body::BoucWen { sigma, power, beta } => {
                let same = (x[0] * du).signum();
                vec![sigma * du * (1.0 - x[0].abs().powf(*power) * (1.0 - beta + beta * same))]
            }
            Body::SemilinearDuhem { states } => states
                .iter()
                .zip(x)
                .map(|([up, down, _], x)| {
                    let rate = if du > 0.0 { up } else { down };
                    rate * du.abs() * (u - x) + at_once * du
                })
                .collect(),
            _ => vec![0.0; x.len()],
        }
    }

    fn displacement(&self, u: f64) -> f64 {
        match &self.body {
            Body::Dahl { .. } | Body::BoucWen { .. } => u - self.strength * self.states[0],
            Body::SemilinearDuhem { states } => states.iter().zip(&self.states).map(|(s, x)| s[2] * x).sum(),
            _ => self.states[0],
        }
    }

    fn by_plays(&mut self, u: f64) -> f64 {
        let Body::GeneralisedPlay { up, down, plays } = &self.body else {
            return u;
        };
        let envelope = |e: &[f64; 2]| (e[0] * u + e[1]).tanh() / e[0];
        let (rising, falling) = (envelope(up), envelope(down));
        let mut sum = 0.0;
        for (state, [threshold, weight]) in self.states.iter_mut().zip(plays) {
            *state = state.min(falling + threshold).max(rising - threshold);
            sum += weight * *state;
        }
        (1.0 - self.strength) * u + self.strength * sum
    }

    /// Madelung's rules: a branch begins at its turning point, and where it passes the turn before, both are forgotten.
    fn by_turns(&mut self, u: f64) -> f64 {
        let rises = self.turns.len() % 2 == 1;
        if u != self.last && (u > self.last) != rises {
            let here = self.on_branch(self.last);
            self.turns.push([self.last, here]);
        }
        while let [.., before, _] = self.turns.as_slice() {
            let rises = self.turns.len() % 2 == 1;
            let passes = if rises { u >= before[0] } else { u <= before[0] };
            if !passes || self.turns.len() < 3 {
                break;
            }
            self.turns.truncate(self.turns.len() - 2);
        }
        self.on_branch(u)
    }

    fn on_branch(&self, u: f64) -> f64 {
        let Some([from, y]) = self.turns.last() else { return u };
        let size = self.everett(u.max(*from), u.min(*from));
        y + if u > *from { size } else { -size }
    }

    fn everett(&self, high: f64, low: f64) -> f64 {
        let d = high - low;
        match &self.body {
            Body::RambergOsgood { power } => {
                2.0 * ((1.0 - self.strength) * 0.5 * d + self.strength * (0.5 * d).powf(*power))
            }
            Body::SkewedEverett { lean, soft, curve } => {
                let curve = |u: f64| u + curve[0] * u * u + curve[1] * u.powi(3);
                let density = self.strength * d * d / (1.0 + soft * d) * (1.0 + lean * 0.5 * (high + low));
                curve(high) - curve(low) + density
            }
            _ => d,
        }
    }
}

struct FullLoop {
    low: f64,
    high: f64,
    opening: f64,
    least_slope: f64,
}

/// Parameters of a stage, and the strength beyond which the slope after a reversal would fall below a quarter.
fn draw_body(family: Family, rng: &mut Pcg64) -> (Body, f64) {
    let mut between = |low: f64, high: f64| rng.random_range(low..high);
    match family {
        Family::ColemanHodgdon => {
            let (alpha, bend) = (between(0.8, 2.0), between(-0.08, 0.08));
            (Body::ColemanHodgdon { alpha, bend }, 0.6)
        }
        Family::Dahl => {
            let (sigma, power) = (between(1.0, 1.9), between(0.9, 1.15));
            (Body::Dahl { sigma, power }, 0.75 / (sigma * 2f64.powf(power)))
        }
        Family::RambergOsgood => {
            let power = between(1.5, 2.6);
            (Body::RambergOsgood { power }, 0.7)
        }
        Family::GeneralisedPlay => {
            let (up, shift, lean) = (between(0.3, 0.8), between(-0.2, 0.2), between(0.01, 0.04));
            let decay = between(2.0, 5.0);
            let mut plays: Vec<[f64; 2]> = (0..36)
                .map(|k| {
                    let threshold = 0.06 + 0.022 * f64::from(k);
                    [threshold, (-decay * threshold).exp()]
                })
                .collect();
            let sum: f64 = plays.iter().map(|p| p[1]).sum();
            plays.iter_mut().for_each(|p| p[1] /= sum);
            let (up, down) = ([up, shift], [up * (1.0 - lean), shift + lean * up]);
            (Body::GeneralisedPlay { up, down, plays }, 0.75)
        }
        Family::SemilinearDuhem => {
            let (slow, fast, share) = (between(0.7, 1.3), between(3.0, 6.0), between(0.6, 0.85));
            let (lean, lean2) = (between(0.85, 1.2), between(0.85, 1.2));
            let states = [[slow, slow * lean, share], [fast, fast * lean2, 1.0 - share]];
            (Body::SemilinearDuhem { states }, 0.62)
        }
        Family::SkewedEverett => {
            let lean = between(0.25, 0.7) * if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
            let (soft, curve) = (between(0.0, 0.5), [between(-0.06, 0.06), between(-0.06, 0.04)]);
            (Body::SkewedEverett { lean, soft, curve }, 1.5)
        }
        Family::BoucWen => {
            let (sigma, power, beta) = (between(0.9, 1.8), between(1.0, 1.6), between(0.55, 0.8));
            (Body::BoucWen { sigma, power, beta }, 0.75 / (sigma * 2.0 * beta))
        }
    }
}
