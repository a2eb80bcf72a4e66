"""Message definitions: schema -> layout -> columns; reading and writing of messages."""
