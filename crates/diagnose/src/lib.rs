//! hysteron-diagnose
