//! Who may ask: loopback, the right address, the right token, no foreign page.

use crate::error::{LabError, Refusal};
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::fmt::Write;
use subtle::ConstantTimeEq;

/// What a request must bring.
#[derive(Debug, Clone)]
pub(crate) struct Guard {
    token: String,
    hosts: [String; 2],
}

/// Bytes of the token: 128 bits cannot be guessed.
const TOKEN_BYTES: usize = 16;

/// Nothing from outside, nothing framed, nothing kept, no address told to others.
const HEADERS: [(&str, &str); 6] = [
    (
        "content-security-policy",
        "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    ),
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-resource-policy", "same-origin"),
    ("cache-control", "no-store"),
];

impl Guard {
    /// A guard with a fresh token for a port.
    pub(crate) fn new(port: u16) -> Result<Self, LabError> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes).map_err(|error| LabError::Token(error.to_string()))?;
        let token = bytes.iter().fold(String::new(), |mut text, byte| {
            // Writing to a String does not fail.
            let _ = write!(text, "{byte:02x}");
            text
        });
        Ok(Self {
            token,
            hosts: [format!("127.0.0.1:{port}"), format!("localhost:{port}")],
        })
    }

    /// The address with the token.
    pub(crate) fn address(&self) -> String {
        format!("http://{}/{}/", self.hosts[0], self.token)
    }

    /// The path behind the token, or why the request is refused.
    fn admit(&self, path: &str, headers: &HeaderMap) -> Result<String, Refusal> {
        let forbidden = |message: &str| Refusal::new(StatusCode::FORBIDDEN, message);
        let text = |name: header::HeaderName| headers.get(name).map(|value| value.to_str().unwrap_or("?"));
        let host = text(header::HOST).unwrap_or("");
        if !self.hosts.iter().any(|own| own == host) {
            return Err(forbidden("this server answers to 127.0.0.1 and localhost only"));
        }
        if let Some(origin) = text(header::ORIGIN)
            && !self.hosts.iter().any(|own| origin.strip_prefix("http://") == Some(own))
        {
            return Err(forbidden("a page of another origin may not ask here"));
        }
        let site = headers.get("sec-fetch-site").map(|value| value.to_str().unwrap_or("?"));
        if site.is_some_and(|site| !matches!(site, "same-origin" | "none")) {
            return Err(forbidden("a page of another site may not ask here"));
        }
        let (token, rest) = path.trim_start_matches('/').split_once('/').unwrap_or(("", ""));
        if !bool::from(token.as_bytes().ct_eq(self.token.as_bytes())) {
            return Err(forbidden(
                "the address lacks the token; open the one that `hysteron lab` printed",
            ));
        }
        Ok(format!("/{rest}"))
    }
}

/// Refuses strangers; takes the token off the path of everyone else.
pub(crate) async fn check(State(guard): State<Guard>, mut request: Request<Body>, next: Next) -> Response {
    let mut response = match guard.admit(request.uri().path(), request.headers()) {
        Err(refusal) => refusal.into_response(),
        Ok(path) => {
            let whole = match request.uri().query() {
                Some(query) => format!("{path}?{query}"),
                None => path,
            };
            match whole.parse::<Uri>() {
                Err(_) => Refusal::bad("this address cannot be read").into_response(),
                Ok(uri) => {
                    *request.uri_mut() = uri;
                    next.run(request).await
                }
            }
        }
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}
