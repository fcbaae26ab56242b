//! The address of a session: its port and its token, the same after a restart, so that a bookmark and an open tab go on.

use crate::error::LabError;
use crate::folder::Readers;
use serde::{Deserialize, Serialize};
use std::fmt::Write;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::Path;

/// Bytes of the token: 128 bits cannot be guessed.
const TOKEN_BYTES: usize = 16;

/// Its file in the session's folder. The point keeps it out of the archive that is taken home, and nobody but the owner may read it.
const FILE: &str = ".address";

/// Where a session is found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Address {
    pub(crate) port: u16,
    pub(crate) token: String,
}

/// A random word that cannot be guessed.
pub(crate) fn random() -> Result<String, LabError> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes).map_err(|error| LabError::Token(error.to_string()))?;
    Ok(bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a String does not fail.
        let _ = write!(text, "{byte:02x}");
        text
    }))
}

impl Address {
    /// Takes the port, on loopback only: the one that is asked for, else the session's last one while it is free, else any.
    pub(crate) fn take(folder: &Path, port: u16) -> Result<(TcpListener, Self), LabError> {
        let file = folder.join(FILE);
        let last = Self::read(&file);
        let bind = |port: u16| TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
        let again = last
            .as_ref()
            .filter(|_| port == 0)
            .and_then(|last| bind(last.port).ok());
        let listener = match again {
            Some(listener) => listener,
            None => bind(port).map_err(|source| LabError::Listen { port, source })?,
        };
        let address = Self {
            port: listener.local_addr()?.port(),
            token: match last {
                Some(last) => last.token,
                None => random()?,
            },
        };
        let failed = |reason: String| LabError::Session {
            folder: folder.display().to_string(),
            reason,
        };
        let text = serde_json::to_string(&address).map_err(|error| failed(error.to_string()))?;
        crate::folder::write_for(&file, text.as_bytes(), Readers::Owner).map_err(|refusal| failed(refusal.message))?;
        Ok((listener, address))
    }

    /// The address that was used last; one that cannot be read, or whose token could be guessed, is none.
    fn read(file: &Path) -> Option<Self> {
        let last: Self = serde_json::from_str(&std::fs::read_to_string(file).ok()?).ok()?;
        let whole = last.token.len() == 2 * TOKEN_BYTES && last.token.bytes().all(|byte| byte.is_ascii_hexdigit());
        whole.then_some(last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_an_address_is_found_again() {
        let place = tempfile::tempdir().unwrap();
        let (listener, first) = Address::take(place.path(), 0).unwrap();
        assert_eq!(first.port, listener.local_addr().unwrap().port());
        // While the port is taken, another one; the token stays.
        let (other, second) = Address::take(place.path(), 0).unwrap();
        assert!(second.port != first.port && second.token == first.token);
        drop((listener, other));
        assert_eq!(Address::take(place.path(), 0).unwrap().1, second);
        assert_eq!(Address::take(place.path(), first.port).unwrap().1, first);
    }

    #[test]
    fn refuse_a_token_that_could_be_guessed() {
        let place = tempfile::tempdir().unwrap();
        for text in [
            "",
            "{}",
            r#"{"port":0,"token":""}"#,
            r#"{"port":0,"token":"0123456789abcdef"}"#,
            r#"{"port":0,"token":"../../../../../../../../../../etc"}"#,
        ] {
            std::fs::write(place.path().join(FILE), text).unwrap();
            let (_, address) = Address::take(place.path(), 0).unwrap();
            assert_eq!(address.token.len(), 2 * TOKEN_BYTES, "{text}");
            assert!(!text.contains(&address.token), "{text}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn val_only_the_owner_may_read_the_token() {
        use std::os::unix::fs::PermissionsExt;
        let place = tempfile::tempdir().unwrap();
        std::fs::write(place.path().join(FILE), "open to all").unwrap();
        Address::take(place.path(), 0).unwrap();
        let mode = std::fs::metadata(place.path().join(FILE)).unwrap().permissions().mode();
        assert_eq!(mode & 0o077, 0, "{mode:o}");
    }
}
