"""Documents for a reader: blocks of text, tables and pictures -> Markdown, or one HTML file."""
