//! Who may ask: loopback, the right address, the right token, no foreign page.
//!
//! What protects, each against another stranger:
//! - The port is bound on loopback: no other machine gets through.
//! - `Host` must be this address: a name of someone else's that was rebound to loopback is refused.
//! - `Origin` and `Sec-Fetch-Site` must be this page's own: another site cannot ask through the user's browser, even where it knows
//!   the address.
//! - The token is 128 random bits in the path, compared in constant time: another user of this machine, or a page that guesses
//!   ports, does not know it. The page never tells it to others (`referrer-policy`), and no cookie carries it.
//!
//! The token is kept from one run to the next, so that a bookmark and an open tab go on ([`crate::address`]): in the session's
//! folder, for its owner alone, and not in the archive that is taken home. Who can read it there can read the session as well, so it
//! gives nothing away. One thing it does cost: who takes the port while no server runs sees the token that an open tab asks with. On
//! a machine with users whom one distrusts, `.address` is to be removed before the next start.

use crate::address::Address;
use crate::error::Refusal;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use subtle::ConstantTimeEq;

/// What a request must bring.
#[derive(Debug, Clone)]
pub(crate) struct Guard {
    token: String,
    hosts: [String; 2],
}

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
    /// A guard for an address.
    pub(crate) fn new(address: &Address) -> Self {
        let Address { port, token } = address;
        Self {
            token: token.clone(),
            hosts: [format!("127.0.0.1:{port}"), format!("localhost:{port}")],
        }
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
                "this address is none of this session's; open the one that `hysteron lab` printed",
            ));
        }
        Ok(format!("/{rest}"))
    }
}

/// Whether a person looks at the answer.
fn wants_a_page(headers: &HeaderMap) -> bool {
    let accept = headers.get(header::ACCEPT).and_then(|value| value.to_str().ok());
    accept.is_some_and(|accept| accept.contains("text/html"))
}

/// A refusal as a page: an old bookmark must say what to do.
fn page(refusal: &Refusal) -> Response {
    let mut reason = refusal.message.clone();
    if let Some(first) = reason.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    let text = format!(
        "<!DOCTYPE html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\"><meta \
         name=\"color-scheme\" content=\"light dark\"><title>Hysteron workbench</title><body style=\"font: 16px/1.5 system-ui, \
         sans-serif; max-width: 40rem; margin: 3rem auto; padding: 0 1rem\"><h1 style=\"font-size: 1.3rem\">Not the address of this \
         session</h1><p>{reason}.</p><p>A session keeps its address from one start to the next. Here runs another session, or \
         another server: start <code>hysteron lab</code> with the <code>--session</code> that you want.</p>"
    );
    let kind = [(header::CONTENT_TYPE, "text/html; charset=utf-8")];
    (refusal.status, kind, text).into_response()
}

/// Refuses strangers; takes the token off the path of everyone else.
pub(crate) async fn check(State(guard): State<Guard>, mut request: Request<Body>, next: Next) -> Response {
    let mut response = match guard.admit(request.uri().path(), request.headers()) {
        Err(refusal) if wants_a_page(request.headers()) => page(&refusal),
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
