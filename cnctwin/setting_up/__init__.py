"""A plant's folder, set up by questions and answers: `cnctwin init`.

dialog (who answers) → set_up (what is asked, and tried, and which files come of it) → planned_files (a diff, then all at once)
"""
