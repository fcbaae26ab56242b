//! A challenge as a folder: the dataset, the sealed truth, the answer, and in the end the truth.

use crate::judge::{Answer, Judgement, judge};
use crate::truth::SealedTruth;
use crate::{ChallengeError, seal};
use hysteron_data::{Dataset, Overwrite, read_dataset, write_dataset};
use serde::Serialize;
use std::path::Path;

/// The file that holds the truth, sealed.
pub const SEALED: &str = "sealed.txt";
/// The file that holds the answer.
pub const ANSWER: &str = "answer.json";
/// The file that holds the truth once it has been shown.
pub const REVEALED: &str = "truth.json";

/// A challenge that is not written yet.
#[derive(Debug, Clone, PartialEq)]
pub struct Riddle {
    /// What the user gets.
    pub dataset: Dataset,
    /// The truth, encrypted.
    pub sealed: String,
    /// What opens it.
    pub key: String,
}

impl Riddle {
    /// Writes dataset and sealed truth into a folder, the key into a file apart.
    ///
    /// # Errors
    /// A challenge or a dataset that is there already; a key inside of the folder; what the system refuses.
    pub fn write(&self, folder: &Path, key_file: &Path) -> Result<(), ChallengeError> {
        refuse_places(folder, key_file)?;
        write_dataset(&self.dataset, folder, Overwrite::Refuse)?;
        write(&folder.join(SEALED), &self.sealed)?;
        write(key_file, &self.key)
    }
}

/// Refuses places where a challenge cannot be written, before the work of making one.
///
/// # Errors
/// A challenge or a key that is there already; a key inside of the folder that it opens.
pub fn refuse_places(folder: &Path, key_file: &Path) -> Result<(), ChallengeError> {
    if key_file.starts_with(folder) {
        return Err(ChallengeError::Refused(format!(
            "--key {}: the key must lie outside of the folder that it opens",
            key_file.display()
        )));
    }
    match [key_file, &folder.join(SEALED)].into_iter().find(|path| path.exists()) {
        None => Ok(()),
        Some(path) => Err(ChallengeError::Refused(format!(
            "{} is there already; a challenge is never replaced, choose another folder",
            path.display()
        ))),
    }
}

/// How a challenge stands: answer and judgement, as far as they are there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Revealed {
    /// What was hidden.
    pub truth: SealedTruth,
    /// What was answered.
    pub answer: Option<Answer>,
    /// How the answer stands to the truth.
    pub judgement: Option<Judgement>,
}

/// Whether a folder is a challenge.
pub fn is_challenge(folder: &Path) -> bool {
    folder.join(SEALED).exists()
}

/// Takes an answer; only the first one counts.
///
/// # Errors
/// A folder that is no challenge; a name that is not known; an answer that was given before, or after the truth was shown.
pub fn answer(folder: &Path, names: &[String]) -> Result<Answer, ChallengeError> {
    sealed_text(folder)?;
    let refused = |reason: String| ChallengeError::Refused(format!("{}: {reason}", folder.display()));
    if folder.join(REVEALED).exists() {
        return Err(refused(
            "its truth has been shown; an answer comes before that".to_owned(),
        ));
    }
    if let Some(before) = read_answer(folder)? {
        return Err(refused(format!(
            "`{}` was answered before, and the first answer counts; `hysteron challenge reveal` shows the truth",
            before.effects.join(", ")
        )));
    }
    let answer = Answer::new(names).map_err(ChallengeError::Refused)?;
    // An answer needs data that can be read: it may be judged by others.
    read_dataset(folder)?;
    write(&folder.join(ANSWER), &(serde_json::to_string_pretty(&answer)? + "\n"))?;
    Ok(answer)
}

/// Opens the truth with the key's file, judges the answer, and leaves the truth in the folder.
///
/// # Errors
/// A folder that is no challenge; a file that is no key, or another challenge's.
pub fn reveal(folder: &Path, key_file: &Path) -> Result<Revealed, ChallengeError> {
    let sealed = sealed_text(folder)?;
    let text = seal::open(&sealed, &read(key_file)?)
        .map_err(|reason| ChallengeError::Refused(format!("{}: {reason}", key_file.display())))?;
    let truth: SealedTruth = serde_json::from_str(&text)?;
    let answer = read_answer(folder)?;
    write(&folder.join(REVEALED), &(serde_json::to_string_pretty(&truth)? + "\n"))?;
    let judgement = answer.as_ref().map(|answer| judge(answer, &truth));
    Ok(Revealed {
        truth,
        answer,
        judgement,
    })
}

/// The answer that was given, and the truth with its judgement once it has been shown.
///
/// # Errors
/// A folder that is no challenge; files that are not as this program writes them.
pub fn stands(folder: &Path) -> Result<(Option<Answer>, Option<Revealed>), ChallengeError> {
    sealed_text(folder)?;
    let answer = read_answer(folder)?;
    let place = folder.join(REVEALED);
    if !place.exists() {
        return Ok((answer, None));
    }
    let truth: SealedTruth = serde_json::from_str(&read(&place)?)?;
    let judgement = answer.as_ref().map(|answer| judge(answer, &truth));
    let revealed = Revealed {
        truth,
        answer: answer.clone(),
        judgement,
    };
    Ok((answer, Some(revealed)))
}

fn sealed_text(folder: &Path) -> Result<String, ChallengeError> {
    if !is_challenge(folder) {
        return Err(ChallengeError::Refused(format!(
            "{}: no challenge (it has no {SEALED}); `hysteron challenge new FOLDER` makes one",
            folder.display()
        )));
    }
    read(&folder.join(SEALED))
}

fn read_answer(folder: &Path) -> Result<Option<Answer>, ChallengeError> {
    let place = folder.join(ANSWER);
    if !place.exists() {
        return Ok(None);
    }
    let answer: Answer = serde_json::from_str(&read(&place)?).map_err(|error| {
        ChallengeError::Refused(format!(
            "{}: no answer as this program writes it: {error}",
            place.display()
        ))
    })?;
    Answer::new(&answer.effects)
        .map(Some)
        .map_err(|reason| ChallengeError::Refused(format!("{}: {reason}", place.display())))
}

fn read(path: &Path) -> Result<String, ChallengeError> {
    std::fs::read_to_string(path).map_err(|source| file_error(path, source))
}

/// Writes a file as a whole: first beside its place, then into it.
fn write(path: &Path, text: &str) -> Result<(), ChallengeError> {
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|source| file_error(folder, source))?;
    }
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    std::fs::write(&beside, text)
        .and_then(|()| std::fs::rename(&beside, path))
        .map_err(|source| file_error(path, source))
}

fn file_error(path: &Path, source: std::io::Error) -> ChallengeError {
    ChallengeError::File {
        file: path.display().to_string(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Setting;

    /// The first answer counts, the truth opens with its own key alone, and what was shown can be shown again.
    #[test]
    fn val_a_challenge_goes_from_setting_to_judgement() {
        let place = tempfile::tempdir().unwrap();
        let (folder, key) = (place.path().join("data"), place.path().join("data.key"));
        let setting = Setting {
            effects: vec!["delay".to_owned()],
            seed: Some(11),
            ..Setting::default()
        };
        let riddle = setting.make().unwrap();
        riddle.write(&folder, &key).unwrap();
        assert!(
            riddle
                .write(&folder, &key)
                .unwrap_err()
                .to_string()
                .contains("never replaced")
        );
        assert_eq!(stands(&folder).unwrap(), (None, None));
        answer(&folder, &["creep".to_owned()]).unwrap();
        let again = answer(&folder, &["delay".to_owned()]).unwrap_err().to_string();
        assert!(again.contains("`creep` was answered before"), "{again}");
        std::fs::write(place.path().join("other.key"), "00".repeat(32)).unwrap();
        let refused = reveal(&folder, &place.path().join("other.key"))
            .unwrap_err()
            .to_string();
        assert!(refused.contains("does not open"), "{refused}");
        let revealed = reveal(&folder, &key).unwrap();
        assert_eq!(revealed.truth.hidden[0].effect, "delay");
        assert_eq!(revealed.judgement.as_ref().unwrap().outcome, crate::Outcome::Wrong);
        assert_eq!(stands(&folder).unwrap().1, Some(revealed));
    }
}
