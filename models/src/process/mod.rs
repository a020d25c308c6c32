//! Process models.
