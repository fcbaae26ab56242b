//! `modelDescription.xml` and `buildDescription.xml`.

use crate::Variable;
use crate::pack::Fmu;
use std::fmt::Write;

/// Units as the standard asks for them: exponents of base units, factor, offset.
const UNITS: [(&str, &str); 4] = [
    ("s", "<BaseUnit s=\"1\"/>"),
    ("V", "<BaseUnit kg=\"1\" m=\"2\" s=\"-3\" A=\"-1\"/>"),
    ("um", "<BaseUnit m=\"1\" factor=\"1e-6\"/>"),
    ("degC", "<BaseUnit K=\"1\" offset=\"273.15\"/>"),
];

impl Fmu {
    /// `token` ties the description to the library.
    pub(crate) fn description(&self, token: &str) -> String {
        let (name, period_s) = (&self.name, self.period_s);
        let mut text = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <fmiModelDescription fmiVersion=\"3.0\" modelName=\"{name}\" instantiationToken=\"{token}\"\n  \
             description=\"{}\" version=\"{version}\" generationTool=\"hysteron {version}\">\n  \
             <CoSimulation modelIdentifier=\"{name}\" canHandleVariableCommunicationStepSize=\"true\" fixedInternalStepSize=\"{period_s:?}\"/>\n  \
             <UnitDefinitions>\n",
            self.words,
            version = env!("CARGO_PKG_VERSION"),
        );
        // Writing to a String does not fail.
        for (unit, base) in UNITS {
            let _ = writeln!(text, "    <Unit name=\"{unit}\">{base}</Unit>");
        }
        let _ = write!(
            text,
            "  </UnitDefinitions>\n  <DefaultExperiment startTime=\"0\" stepSize=\"{period_s:?}\"/>\n  <ModelVariables>\n    \
             <Float64 name=\"time\" valueReference=\"0\" causality=\"independent\" variability=\"continuous\" unit=\"s\"/>\n"
        );
        for (place, variable) in (1..).zip(&self.variables) {
            let Variable {
                name,
                unit,
                input,
                words,
            } = variable;
            let causality = if *input {
                "causality=\"input\" variability=\"discrete\" start=\"0\""
            } else {
                "causality=\"output\" variability=\"discrete\""
            };
            let _ = writeln!(
                text,
                "    <Float64 name=\"{name}\" valueReference=\"{place}\" {causality} unit=\"{unit}\" description=\"{words}\"/>"
            );
        }
        text.push_str("  </ModelVariables>\n  <ModelStructure>\n");
        for kind in ["Output", "InitialUnknown"] {
            for (place, _) in (1..).zip(&self.variables).filter(|(_, variable)| !variable.input) {
                let _ = writeln!(text, "    <{kind} valueReference=\"{place}\"/>");
            }
        }
        text.push_str("  </ModelStructure>\n</fmiModelDescription>\n");
        text
    }

    /// How another compiler makes the library of the sources.
    pub(crate) fn build_description(&self) -> String {
        let name = &self.name;
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiBuildDescription fmiVersion=\"3.0\">\n  \
             <BuildConfiguration modelIdentifier=\"{name}\">\n    <SourceFileSet language=\"C99\" compilerOptions=\"-ffp-contract=off\">\n      \
             <SourceFile name=\"fmi3.c\"/>\n      <SourceFile name=\"{name}.c\"/>\n    </SourceFileSet>\n  \
             </BuildConfiguration>\n</fmiBuildDescription>\n"
        )
    }
}
