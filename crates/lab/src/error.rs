//! What a request or a start can end with but an answer.

use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use hysteron_control::ControlError;

/// Why the workbench cannot start.
#[derive(Debug, thiserror::Error)]
pub enum LabError {
    /// The port is taken or forbidden.
    #[error("cannot listen on 127.0.0.1:{port}: {source}")]
    Listen {
        /// The port that was asked for.
        port: u16,
        /// What the system said.
        source: std::io::Error,
    },
    /// The folder of the session cannot be used.
    #[error("session {folder}: {reason}")]
    Session {
        /// The folder.
        folder: String,
        /// Why.
        reason: String,
    },
    /// The system gives no random numbers for the token.
    #[error("no random numbers for the token: {0}")]
    Token(String),
    /// The server broke off.
    #[error("the server broke off: {0}")]
    Serve(#[from] std::io::Error),
    /// The dataset given at the start.
    #[error(transparent)]
    Data(#[from] hysteron_data::DataError),
}

/// A request that is refused, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refusal {
    pub(crate) status: StatusCode,
    pub(crate) message: String,
}

impl Refusal {
    pub(crate) fn new(status: StatusCode, message: impl Into<String>) -> Self {
        Self {
            status,
            message: message.into(),
        }
    }

    /// The request makes no sense as it is.
    pub(crate) fn bad(message: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, message)
    }

    /// It makes sense, but not now.
    pub(crate) fn conflict(message: impl Into<String>) -> Self {
        Self::new(StatusCode::CONFLICT, message)
    }

    /// What it asks about is not there.
    pub(crate) fn absent(message: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, message)
    }

    /// What it brings cannot be used.
    pub(crate) fn unusable(message: impl ToString) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, message.to_string())
    }

    /// The disk.
    pub(crate) fn disk(what: &std::path::Path, source: &dyn std::fmt::Display) -> Self {
        Self::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            format!("{}: {source}", what.display()),
        )
    }
}

impl From<ControlError> for Refusal {
    /// The page's fields have the names of the options beside them.
    fn from(error: ControlError) -> Self {
        Self::unusable(error.worded(hysteron_report::option))
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        (self.status, axum::Json(serde_json::json!({ "error": self.message }))).into_response()
    }
}
