//! What a recording is once it is in memory: columns with units, a uniform sample clock, a role.

/// What a record is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The model is fitted to it.
    Identify,
    /// The model is judged on it.
    Validate,
}

impl Role {
    /// The name used on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Identify => "identify",
            Self::Validate => "validate",
        }
    }
}

/// One uniformly sampled run of the stage. All columns have the same length, at least 2, and only finite values.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// File name, relative to the dataset's folder.
    pub file: String,
    /// What the record is used for.
    pub role: Role,
    /// The excitation in words; for people, never parsed.
    pub excitation: String,
    /// Time of the first sample, seconds.
    pub start_s: f64,
    /// Sample period, seconds.
    pub period_s: f64,
    /// Voltage commanded at the actuator, volts.
    pub voltage_v: Vec<f64>,
    /// Measured displacement, micrometres.
    pub position_um: Vec<f64>,
    /// Desired displacement, micrometres.
    pub reference_um: Option<Vec<f64>>,
    /// Stage temperature, degrees Celsius.
    pub temperature_c: Option<Vec<f64>>,
    /// Voltage commanded on the other axis, volts.
    pub voltage2_v: Option<Vec<f64>>,
}

impl Record {
    /// Voltage, volts, and position, micrometres, from 0 s on, and nothing else.
    pub fn new(file: impl Into<String>, role: Role, period_s: f64, voltage_v: Vec<f64>, position_um: Vec<f64>) -> Self {
        Self {
            file: file.into(),
            role,
            excitation: String::new(),
            start_s: 0.0,
            period_s,
            voltage_v,
            position_um,
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.voltage_v.len()
    }

    /// Whether there are no samples (a record that was read has at least 2).
    pub fn is_empty(&self) -> bool {
        self.voltage_v.is_empty()
    }

    /// Duration from the first to the last sample, seconds.
    pub fn duration_s(&self) -> f64 {
        self.period_s * self.len().saturating_sub(1) as f64
    }

    /// Sample rate, hertz: what a person writes where that and the period differ by their rounding only, so that a period
    /// of 1/12000 s is 12000 Hz and not 11999.999999999998 Hz.
    pub fn rate_hz(&self) -> f64 {
        crate::clock::rate(self.period_s)
    }

    /// Samples at which the position stays exactly at a value while the voltage moves: at its highest or lowest, a sensor or converter
    /// at the end of its range.
    pub fn stuck_at(&self, position_um: f64) -> usize {
        let y = &self.position_um;
        (1..self.len())
            .filter(|&k| y[k] == position_um && y[k - 1] == position_um && self.voltage_v[k] != self.voltage_v[k - 1])
            .count()
    }
}

/// A reference that a stage is to follow, uniformly sampled: at least 2 finite values.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// Time of the first sample, seconds.
    pub start_s: f64,
    /// Sample period, seconds.
    pub period_s: f64,
    /// Desired displacement, micrometres.
    pub reference_um: Vec<f64>,
}

impl Reference {
    /// Sample rate, hertz, as [`Record::rate_hz`].
    pub fn rate_hz(&self) -> f64 {
        crate::clock::rate(self.period_s)
    }
}

/// What is known of the measuring chain, from `[known]` in `dataset.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Known {
    /// From a reading to the mean effect of its command, seconds: the latency of the controller and half a sample of hold.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_s: Option<f64>,
    /// Sensor noise, micrometres rms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_noise_um: Option<f64>,
    /// Bandwidth of the sensor, hertz: where its filter of first order leaves 0.71 (-3 dB).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_bandwidth_hz: Option<f64>,
    /// Lowest voltage the amplifier gives, volts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voltage_min_v: Option<f64>,
    /// Highest voltage the amplifier gives, volts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voltage_max_v: Option<f64>,
    /// Volts at the actuator of the DAC's lowest code and of full scale, one step above its highest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dac_v: Option<[f64; 2]>,
    /// Micrometres of the ADC's lowest code and of full scale, one step above its highest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adc_um: Option<[f64; 2]>,
}

/// Something the reader did that the user should know: a unit converted, a column ignored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    /// The file it is about.
    pub file: String,
    /// What was done.
    pub text: String,
}

/// A set of records of one stage.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Dataset {
    /// Short name.
    pub name: String,
    /// Free text.
    pub description: String,
    /// What is known of the measuring chain.
    pub known: Known,
    /// The records, in the order they were taken.
    pub records: Vec<Record>,
    /// What the reader did that the user should know.
    pub notices: Vec<Notice>,
}

impl Dataset {
    /// The records with a role.
    pub fn with_role(&self, role: Role) -> impl Iterator<Item = &Record> {
        self.records.iter().filter(move |record| record.role == role)
    }
}
