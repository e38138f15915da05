"""Watch a run in a browser: page, server, file to send, report; nothing else imports it."""
