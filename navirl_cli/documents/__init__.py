"""Reports: blocks of text, tables and pictures, written as text, Markdown, HTML, CSV, LaTeX or JSON."""
