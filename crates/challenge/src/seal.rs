//! Sealing a text: XChaCha20-Poly1305 (RFC 8439 with a nonce of 24 bytes), whose tag refuses every other key.

use chacha20poly1305::aead::Aead;
use chacha20poly1305::{Key, KeyInit, XChaCha20Poly1305, XNonce};
use rand::Rng;

/// First line of a sealed file.
const HEADER: &str = "hysteron challenge 1, XChaCha20-Poly1305: nonce, then ciphertext";
/// Texts are padded to a multiple of this, so that their length tells nothing: the truth of a pair takes below 2000 bytes.
const PADDED_BYTES: usize = 4096;
const NONCE_BYTES: usize = 24;
const KEY_BYTES: usize = 32;

/// Seals a text with a key of the system's randomness; returns the key's file and the sealed file.
pub(crate) fn seal(text: &str) -> (String, String) {
    let (mut key, mut nonce) = ([0_u8; KEY_BYTES], [0_u8; NONCE_BYTES]);
    let mut rng = rand::rng();
    rng.fill_bytes(&mut key);
    rng.fill_bytes(&mut nonce);
    let mut padded = text.as_bytes().to_vec();
    padded.resize(padded.len().next_multiple_of(PADDED_BYTES), b' ');
    // Encryption in memory fails only beyond 256 GB.
    let sealed = XChaCha20Poly1305::new(&Key::from(key))
        .encrypt(&XNonce::from(nonce), padded.as_slice())
        .unwrap_or_default();
    let sealed = format!("{HEADER}\n{}\n{}\n", to_hex(&nonce), to_hex(&sealed));
    (to_hex(&key) + "\n", sealed)
}

/// Opens a sealed file.
///
/// # Errors
/// In words: no key, another challenge's key, a file that is damaged.
pub(crate) fn open(sealed: &str, key: &str) -> Result<String, String> {
    let key: [u8; KEY_BYTES] = from_hex(key.trim())
        .ok_or_else(|| format!("no key: a key is one line of {} hexadecimal digits", 2 * KEY_BYTES))?;
    let mut lines = sealed.lines();
    let damaged = || "the sealed file of the challenge is damaged".to_owned();
    if lines.next() != Some(HEADER) {
        return Err(damaged());
    }
    let nonce: [u8; NONCE_BYTES] = lines.next().and_then(from_hex).ok_or_else(damaged)?;
    let sealed = lines.next().and_then(bytes).ok_or_else(damaged)?;
    let text = XChaCha20Poly1305::new(&Key::from(key))
        .decrypt(&XNonce::from(nonce), sealed.as_slice())
        .map_err(|_| {
            "this key does not open the challenge; take the file that `hysteron challenge new` wrote beside it"
                .to_owned()
        })?;
    String::from_utf8(text).map_err(|_| damaged())
}

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn bytes(hex: &str) -> Option<Vec<u8>> {
    let digits: Vec<u8> = hex
        .chars()
        .map(|c| c.to_digit(16).map(|digit| digit as u8))
        .collect::<Option<_>>()?;
    digits
        .len()
        .is_multiple_of(2)
        .then(|| digits.chunks(2).map(|pair| 16 * pair[0] + pair[1]).collect())
}

fn from_hex<const N: usize>(hex: &str) -> Option<[u8; N]> {
    bytes(hex)?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prop_opens_with_its_key_and_no_other() {
        let (key, sealed) = seal("what is true");
        let (other, again) = seal("what is true");
        assert_eq!(open(&sealed, &key).unwrap().trim(), "what is true");
        assert!(open(&sealed, &other).unwrap_err().contains("does not open"));
        assert_ne!(sealed, again);
        // One digit of key or ciphertext changed.
        let flip = |text: &str, at: usize| {
            let digit = if &text[at..=at] == "0" { "1" } else { "0" };
            format!("{}{digit}{}", &text[..at], &text[at + 1..])
        };
        assert!(open(&sealed, &flip(&key, 5)).is_err());
        assert!(open(&flip(&sealed, sealed.len() - 10), &key).is_err());
    }

    #[test]
    fn refuse_what_is_no_key() {
        let (_, sealed) = seal("x");
        for bad in ["", "xyz", "00", &"0g".repeat(32)] {
            assert!(
                open(&sealed, bad).unwrap_err().contains("64 hexadecimal digits"),
                "{bad}"
            );
        }
        assert!(open("", &"00".repeat(32)).unwrap_err().contains("damaged"));
    }

    #[test]
    fn prop_length_tells_nothing() {
        assert_eq!(seal("a").1.len(), seal(&"b".repeat(3000)).1.len());
    }
}
