//! Each figure of the paper beside ours.

use super::reasons;
use crate::formulas::{self, FIGURE_1_HZ};
use crate::paper::{PUBLISHED_PI_HZ, Study, SwarmRace, find, first_play_lead_s};
use hysteron_identify::Family;
use hysteron_tracking::TrackingError;
use hysteron_tracking::experiment::IDENTIFIED_HZ;

/// A figure of the paper, ours on each stage, and what there is to say.
#[derive(Debug)]
pub(super) struct Row {
    pub what: String,
    pub unit: &'static str,
    pub paper: Option<f64>,
    pub ours: [Option<f64>; 2],
    pub remarks: Vec<String>,
    /// Whether it is a time, which differs from run to run.
    pub is_time: bool,
}

/// Rows of one part of the paper.
#[derive(Debug)]
pub(super) struct Section {
    pub heading: &'static str,
    pub rows: Vec<Row>,
    pub notes: Vec<String>,
}

impl Row {
    fn new(what: impl Into<String>, unit: &'static str, paper: impl Into<Option<f64>>, ours: [Option<f64>; 2]) -> Self {
        Self {
            what: what.into(),
            unit,
            paper: paper.into(),
            ours,
            remarks: Vec::new(),
            is_time: false,
        }
    }

    /// A figure that does not depend on the stage.
    fn same(what: impl Into<String>, unit: &'static str, paper: impl Into<Option<f64>>, ours: f64) -> Self {
        Self::new(what, unit, paper, [Some(ours); 2])
    }

    fn remark(mut self, remark: impl Into<String>) -> Self {
        self.remarks.push(remark.into());
        self
    }

    fn remarks(mut self, remarks: impl IntoIterator<Item = String>) -> Self {
        self.remarks.extend(remarks);
        self
    }
}

/// A figure of each study.
fn each(studies: &[Study], figure: impl Fn(&Study) -> Option<f64>) -> [Option<f64>; 2] {
    core::array::from_fn(|i| studies.get(i).and_then(&figure))
}

/// All figures, in the paper's order.
pub(super) fn sections(studies: &[Study], races: &[SwarmRace]) -> Result<Vec<Section>, TrackingError> {
    Ok(vec![
        table_1(studies),
        paper_formulas()?,
        openings(studies),
        identification(studies, races),
        open_loop(studies),
        gains(studies),
        closed_loop(studies),
        bandwidths(studies),
    ])
}

fn table_1(studies: &[Study]) -> Section {
    // The offset is ours: the sensor's zero, which the paper leaves out.
    let count = |index: usize| {
        each(studies, |study| {
            Some((study.inverses.get(index)?.model.parameters().len() - 1) as f64)
        })
    };
    let elsewhere = |what: &str, paper: f64| {
        Row::new(what, "", paper, [None; 2]).remark(
            "The paper takes nothing but this number from it; `hysteron paper --rivals` identifies and runs ours.",
        )
    };
    Section {
        heading: "Table 1: parameters for N = 10",
        rows: vec![
            Row::new("Ang [20] / our WRPI", "", 24.0, count(1)).remark(
                "Ours are k_i and l_i of 10 plays and a cubic input function of 2; Ang's has m = 4 more operators in its place.",
            ),
            elsewhere("Janaideh [23]", 23.0),
            elsewhere("Janaideh [24]", 16.0),
            elsewhere("Yang [25]", 23.0),
            Row::new("Proposed / our MRPI", "", 14.0, count(2)),
        ],
        notes: vec![
            "Counted on the fitted models; each of ours has one more, an offset, because a sensor's zero is not the stage's."
                .to_owned(),
        ],
    }
}

fn paper_formulas() -> Result<Section, TrackingError> {
    let mut rows = Vec::new();
    for (found, hz) in formulas::figure_1()?.iter().zip(FIGURE_1_HZ) {
        let opening = found.opening_at(0.5).unwrap_or(f64::NAN);
        let closed_form = formulas::figure_1_closed_form(hz);
        let follows = (opening - closed_form).abs() < 2e-3;
        rows.push(
            Row::same(format!("figure 1, opening at mid stroke, {hz} Hz"), "", None, opening).remark(format!(
                "r + (alpha + beta) pi f is {closed_form:.4}{}",
                if follows {
                    "."
                } else {
                    ": here the play can no longer follow its envelope."
                }
            )),
        );
    }
    for found in formulas::figure_2()? {
        let (hz, [low, high]) = (found.frequency_hz, found.range());
        rows.push(Row::same(format!("figure 2, lowest y, {hz} Hz"), "", None, low));
        rows.push(Row::same(format!("figure 2, highest y, {hz} Hz"), "", None, high));
        rows.push(Row::same(
            format!("figure 2, loop area, {hz} Hz"),
            "",
            None,
            found.area(),
        ));
    }
    let table = formulas::table_2()?;
    rows.push(
        Row::same("Table 2, what it asks for at y = 1", "V", None, table.output_at_one).remark(
            "26 V behind an amplifier of 20 is 1.30 V: Table 2 is in volts of the converter, its y of about one sensor volt.",
        ),
    );
    for ((opening, hz), measured) in table.openings_percent.iter().zip(IDENTIFIED_HZ).zip(PAPER_OPENINGS) {
        let row = Row::same(
            format!("Table 2, opening of the loop it inverts, {hz} Hz"),
            "%",
            measured,
            *opening,
        );
        rows.push(if (opening - measured).abs() > 1.0 {
            row.remark(
                "The printed table does not give the measured loop of figure 8 back; it serves to check formulas.",
            )
        } else {
            row
        });
    }
    Ok(Section {
        heading: "Figures 1 and 2, Table 2: the paper's numbers in its formulas",
        rows,
        notes: vec![
            "The paper prints figures 1 and 2 without numbers: ours are what its formulas give at T = 20 us."
                .to_owned(),
        ],
    })
}

/// Measured loop openings, section 4.2, percent.
const PAPER_OPENINGS: [f64; 3] = [16.44, 22.56, 45.51];
/// Weights of eq. 18, section 4.2.
const PAPER_WEIGHTS: [f64; 3] = [1.0, 1.37, 2.77];

fn openings(studies: &[Study]) -> Section {
    let mut rows = Vec::new();
    for (i, hz) in IDENTIFIED_HZ.into_iter().enumerate() {
        rows.push(Row::new(
            format!("loop opening, {hz} Hz"),
            "%",
            PAPER_OPENINGS[i],
            each(studies, |study| Some(study.openings_percent[i])),
        ));
    }
    for (i, hz) in IDENTIFIED_HZ.into_iter().enumerate() {
        rows.push(Row::new(
            format!("weight (18), {hz} Hz"),
            "",
            PAPER_WEIGHTS[i],
            each(studies, |study| Some(study.weights[i])),
        ));
    }
    Section {
        heading: "Figure 8: loop openings and weights",
        rows,
        notes: vec![
            "Both stages are calibrated to these three openings (at mid stroke), and to nothing else of the paper; weights are \
             from the widest openings of our records."
                .to_owned(),
        ],
    }
}

fn identification(studies: &[Study], races: &[SwarmRace]) -> Section {
    let of_race = |what: &str, unit, figure: fn(&SwarmRace) -> f64| {
        Row::new(what, unit, None, core::array::from_fn(|i| races.get(i).map(figure)))
    };
    let time = |what: &str, unit, figure: fn(&SwarmRace) -> f64| Row {
        is_time: true,
        ..of_race(what, unit, figure)
    };
    let envelope = |of: fn(f64, f64) -> f64| {
        each(studies, move |study| {
            let envelope = study.inverses.get(2)?.model.envelope?;
            Some(of(envelope.alpha_s, envelope.beta_s))
        })
    };
    let mut modelling = Row::new(
        "largest modelling error, inverse MRPI",
        "% p-p",
        2.7,
        each(studies, |study| Some(study.modelling.worst().0)),
    );
    for study in studies {
        let list = |values: [f64; 3]| values.map(|value| format!("{value:.1}")).join(" / ");
        modelling = modelling.remark(format!(
            "{}: at 10 / 100 / 500 Hz {} % (rms {} %).",
            study.preset,
            list(study.modelling.largest_percent),
            list(study.modelling.rms_percent)
        ));
    }
    let rows = vec![
        of_race("objective (17), separable", "V²", |race| race.separable_objective),
        of_race("objective (17), particle swarm", "V²", |race| race.swarm_objective),
        of_race("objective, separable over swarm", "", |race| {
            race.separable_objective / race.swarm_objective
        }),
        time("time, separable", "s", |race| race.separable_s),
        time("time, particle swarm", "s", |race| race.swarm_s),
        time("time, swarm over separable", "", |race| race.swarm_s / race.separable_s),
        Row::new("alpha", "us", 21.5, envelope(|alpha_s, _| 1e6 * alpha_s))
            .remark("With r_1 = 0 the records give alpha and beta only as products with the first weight: see below."),
        Row::new("beta", "us", 21.217, envelope(|_, beta_s| 1e6 * beta_s)),
        modelling.remarks(studies.iter().filter_map(reasons::gain_against_rate)),
    ];
    Section {
        heading: "Table 2, figure 9: identification of the inverse MRPI",
        rows,
        notes: r1_trap(studies),
    }
}

/// What r_1 = 0 makes of the identified parameters.
fn r1_trap(studies: &[Study]) -> Vec<String> {
    let mut notes: Vec<String> = studies
        .iter()
        .filter_map(|study| {
            let model = &study.inverses.get(2)?.model;
            let value = |name: &str| {
                let parameter = model.parameters().into_iter().find(|p| p.name == name);
                parameter.map(|parameter| parameter.value)
            };
            let (linear, first) = (value("linear")?, value("weight[1]")?);
            Some(format!(
                "{}: eq. 16 puts r_1 at 0, where the play is v - alpha |v'| going up and v + beta |v'| coming down. Its weight of \
                 {first:.2} V/um and the linear term of {linear:.2} V/um are a static gain of {:.2} V/um and a lead of {:.0} us: \
                 neither means anything alone. The paper's -4.8645 and 6.4714 are a gain of 1.6069 and a lead of {:.0} us.",
                study.preset,
                linear + first,
                1e6 * first_play_lead_s(model)?,
                1e6 * 4.8645 * 0.5 * (2.15e-5 + 2.1217e-5) / 1.6069
            ))
        })
        .collect();
    notes.push(
        "The controllers below run with the separable fits of all three inverses: they reach the lower objective in the same \
         records. Trajectories keep 2 % away from either end of the range that all three records reach, as the amplifier ends \
         at 0 V."
            .to_owned(),
    );
    notes
}

/// The inverses with the paper's open-loop figures at 500 Hz, percent.
const OPEN: [(Family, f64); 3] = [(Family::Mpi, 11.0), (Family::Wrpi, 5.12), (Family::Mrpi, 1.6)];

fn open_loop(studies: &[Study]) -> Section {
    let mut rows = Vec::new();
    for (family, paper) in OPEN {
        let name = family.name().to_uppercase();
        let row = Row::new(
            format!("open loop, {name}, 500 Hz"),
            "% rms",
            paper,
            each(studies, |study| {
                Some(find(&study.open_loop, Some(family), 500.0)?.figures.measured_percent)
            }),
        );
        let row = row
            .remarks(reasons::at_500_hz(studies, false, Some(family), paper))
            .remarks(reasons::other_counting(studies, family));
        rows.push(if family == Family::Mrpi {
            row.remarks(reasons::latency(studies))
        } else {
            row
        });
    }
    for (family, _) in OPEN {
        rows.push(complex(studies, false, Some(family)));
    }
    Section {
        heading: "Figures 10 to 13: open loop",
        rows,
        notes: complex_note(),
    }
}

fn complex_note() -> Vec<String> {
    vec![
        "The paper shows the complex harmonic (figures 13, 17) without a number and without its frequency; ours has a \
         fundamental of 100 Hz, so that its third harmonic lies within what was identified."
            .to_owned(),
    ]
}

fn complex(studies: &[Study], closed: bool, inverse: Option<Family>) -> Row {
    let figure = |study: &Study| {
        let figures = if closed { &study.closed_loop } else { &study.open_loop };
        let found = figures
            .iter()
            .find(|figure| figure.controller.inverse == inverse && figure.complex_harmonic)?;
        Some(found.figures.measured_percent)
    };
    let loop_name = if closed { "closed loop" } else { "open loop" };
    Row::new(
        format!("{loop_name}, {}, complex harmonic", name(closed, inverse)),
        "% rms",
        None,
        each(studies, figure),
    )
}

fn name(closed: bool, inverse: Option<Family>) -> String {
    match (closed, inverse.map(|family| family.name().to_uppercase())) {
        (true, Some(name)) => format!("PI+{name}"),
        (true, None) => "PI".to_owned(),
        (false, name) => name.unwrap_or_default(),
    }
}

fn gains(studies: &[Study]) -> Section {
    let readings = studies.first().map_or(0, |study| study.readings.len());
    let rows = (0..readings)
        .map(|i| {
            let words = studies[0].readings[i].reading.words();
            let mut row = Row::new(
                format!("PI bandwidth, {words}"),
                "Hz",
                PUBLISHED_PI_HZ,
                each(studies, |study| study.readings[i].bandwidth_hz()),
            );
            for study in studies {
                let reading = &study.readings[i];
                if reading.bandwidth_hz().is_none() {
                    row = row.remark(format!(
                        "{}: the loop swings between the amplifier's limits ({:.0} % of samples).",
                        study.preset, reading.bandwidth.limited_percent
                    ));
                } else if let Some(figure) = &reading.at_500_hz {
                    let used = if study.reading == i {
                        " Used: nearest to 36.1 Hz, as a ratio."
                    } else {
                        ""
                    };
                    row = row.remark(format!(
                        "{}: {:.1} % rms at 500 Hz (paper 37 %).{used}",
                        study.preset, figure.figures.measured_percent
                    ));
                }
            }
            row
        })
        .collect();
    // A first-order loop lags by 30 degrees at f_c tan 30; its error at f is f / hypot(f, f_c) of a sine's rms.
    let corner_hz = PUBLISHED_PI_HZ / 30_f64.to_radians().tan();
    let error = 100.0 / 8_f64.sqrt() * 500.0 / 500_f64.hypot(corner_hz);
    Section {
        heading: "K_p = 1, K_i = 6000: the units",
        rows,
        notes: vec![format!(
            "The paper does not state the units of K_p and K_i (the second is per second). Its own figures agree with each \
             other: a first-order loop with 36.1 Hz would be {error:.1} % off at 500 Hz, it says 37 %. So the weak readings are \
             meant, not those in volts of the converter."
        )],
    }
}

/// The closed loops with the paper's figures at 500 Hz, percent.
const CLOSED: [(Option<Family>, f64); 4] = [
    (None, 37.0),
    (Some(Family::Mpi), 12.3),
    (Some(Family::Wrpi), 4.5),
    (Some(Family::Mrpi), 2.3),
];

fn closed_loop(studies: &[Study]) -> Section {
    let mut rows = Vec::new();
    for (inverse, paper) in CLOSED {
        let figure = |study: &Study| Some(find(&study.closed_loop, inverse, 500.0)?.figures.measured_percent);
        rows.push(
            Row::new(
                format!("closed loop, {}, 500 Hz", name(true, inverse)),
                "% rms",
                paper,
                each(studies, figure),
            )
            .remarks(reasons::at_500_hz(studies, true, inverse, paper)),
        );
    }
    rows.extend(CLOSED.map(|(inverse, _)| complex(studies, true, inverse)));
    let mut notes: Vec<String> = studies
        .iter()
        .map(|study| reasons::feedback_helps(study, Family::Mrpi))
        .collect();
    notes.push("The paper finds that feedback helps below 400 Hz and harms at 500 Hz.".to_owned());
    Section {
        heading: "Figures 14 to 17: closed loop",
        rows,
        notes,
    }
}

/// The paper's control bandwidths, hertz.
const BANDWIDTHS: [f64; 4] = [PUBLISHED_PI_HZ, 1020.0, 2280.0, 2460.0];

fn bandwidths(studies: &[Study]) -> Section {
    let rows = CLOSED
        .iter()
        .zip(BANDWIDTHS)
        .enumerate()
        .map(|(i, ((inverse, _), paper))| {
            let figure = |study: &Study| Some(study.bandwidths.get(i)?.lag_30_deg?.frequency_hz);
            Row::new(
                format!("30-degree-lag bandwidth, {}", name(true, *inverse)),
                "Hz",
                paper,
                each(studies, figure),
            )
            .remark(format!("The paper's is a latency of {:.0} us.", 1e6 / (12.0 * paper)))
            .remarks(studies.iter().filter_map(|study| reasons::bandwidth(study, i)))
        })
        .collect();
    Section {
        heading: "Figure 18: bandwidths",
        rows,
        notes: vec![
            "Measured from reference to reading with noise up to 5 kHz about mid range, 5 % of the range rms (the paper states \
             neither band nor amplitude), by averaged cross spectra."
                .to_owned(),
        ],
    }
}
