"""The auditor over the stored captures and random conversations, and the auditor itself against false findings."""
